"""Parts of `Wang2020` in the form in which they are deployed: the same function in layouts that suit runtimes.

Runtimes keep maps in blocks of sixteen channels between 2-D convolutions and leave that layout for most else, which
costs as much as a convolution. So every plane of the volume is a map of its own: joining maps along channels keeps the
layout, cutting planes out of one tensor does not. A convolution to one channel fills one lane of sixteen: that is used
for several planes, or for the pixels of a block.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks.blocks import ConvNorm
from endosdk.training.networks.cost_volume import Aggregation, difference_planes

BLOCK = 4  # px, side of the block that `in_blocks` computes at once


class PlaneAggregation(nn.Module):
    """The same function as `Aggregation`, with a 2-D convolution for every plane and its two neighbours.

    In training the 3-D form is the quicker one. Batch norm must have been folded.
    """

    def __init__(self, source: Aggregation) -> None:
        super().__init__()
        self.planes = source.planes
        layers = [layer for layer in source.layers if isinstance(layer, ConvNorm)]
        self.layers = nn.ModuleList(nn.Sequential(_over_neighbours(layer.conv), layer.activation) for layer in layers)
        self.cost = _to_neighbours(source.cost)
        self.register_buffer("bias", source.cost.bias.detach())  # type: ignore[union-attr]

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Map features of both views [N, C, h, w] to cost [N, h, w, D]."""
        maps = difference_planes(left, right, self.planes)
        beyond = torch.zeros_like(left)  # what lies before the first plane and behind the last
        for layer in self.layers:
            around = [beyond, *maps, beyond]
            maps = [layer(torch.cat(around[plane : plane + 3], dim=1)) for plane in range(self.planes)]
        return self._costs(maps).permute(0, 2, 3, 1)

    def _costs(self, maps: list[Tensor]) -> Tensor:
        """Sum up what every plane adds to its own cost and to those of its neighbours: [N, D, h, w]."""
        after, own, before = (
            torch.cat(part, dim=1) for part in zip(*(self.cost(m).split(1, 1) for m in maps), strict=True)
        )
        lacking = torch.zeros_like(own[:, :1])
        moved = torch.cat([lacking, after[:, :-1]], dim=1) + torch.cat([before[:, 1:], lacking], dim=1)
        return own + moved + self.get_buffer("bias")


def _over_neighbours(conv: nn.Module) -> nn.Conv2d:
    """Make the 2-D convolution that equals a 3x3x3 one on [previous, this, next] plane joined along channels."""
    if not isinstance(conv, nn.Conv3d) or conv.bias is None:
        raise InvalidArgument("network", "must have batch norm folded into its 3-D convolutions", conv)
    flat = nn.Conv2d(conv.in_channels * 3, conv.out_channels, 3, padding=1)
    with torch.no_grad():
        flat.weight.copy_(conv.weight.permute(0, 2, 1, 3, 4).flatten(1, 2))
        flat.bias.copy_(conv.bias)  # type: ignore[union-attr]
    return flat


def _to_neighbours(conv: nn.Conv3d) -> nn.Conv2d:
    """Make the convolution that gives what a plane adds to the next plane's cost, its own, the last one's."""
    flat = nn.Conv2d(conv.in_channels, 3, 3, padding=1, bias=False)
    with torch.no_grad():
        flat.weight.copy_(conv.weight[0].transpose(0, 1))
    return flat


def in_blocks(conv: nn.Conv2d) -> nn.Module:
    """Compute a 3x3 convolution to one channel for a block of pixels at once; sizes must be multiples of `BLOCK`."""
    if conv.out_channels != 1 or conv.kernel_size != (3, 3) or conv.bias is None:
        raise InvalidArgument("conv", "must be a 3x3 convolution to one channel with a bias", conv)
    whole = nn.Conv2d(conv.in_channels, BLOCK**2, BLOCK + 2, stride=BLOCK, padding=1)
    assert whole.bias is not None
    with torch.no_grad():
        whole.weight.zero_()
        whole.bias.copy_(conv.bias.expand(BLOCK**2))
        for place in range(BLOCK**2):
            y, x = divmod(place, BLOCK)
            whole.weight[place, :, y : y + 3, x : x + 3] = conv.weight[0]
    return nn.Sequential(whole, nn.PixelShuffle(BLOCK))
