"""3-D convolutions as 2-D ones over neighbouring planes, for export alone.

The deployed runtime has quick kernels for 2-D convolutions and slow ones for 3-D. Our own networks are exported in this
form, so are these networks: otherwise their times would say more about those kernels than about the networks.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument

KERNEL = (3, 3, 3)
CONVOLUTIONS = (nn.Conv2d, nn.Conv3d, nn.ConvTranspose3d)


class PlaneConv(nn.Module):
    """A 3x3x3 convolution with padding 1 and stride 1 or 2 on a volume [N, C, D, h, w]."""

    def __init__(self, source: nn.Conv3d) -> None:
        super().__init__()
        self.step = source.stride[0]
        if source.kernel_size != KERNEL or source.padding != (1, 1, 1) or len(set(source.stride)) > 1:
            raise InvalidArgument("source", "must be 3x3x3 with padding 1 and one stride", source)
        inputs, outputs = 3 * source.in_channels, source.out_channels
        self.flat = nn.Conv2d(inputs, outputs, 3, self.step, 1, bias=source.bias is not None)
        self.flat.weight = nn.Parameter(source.weight.detach().transpose(1, 2).flatten(1, 2))
        self.flat.bias = source.bias

    def forward(self, volume: Tensor) -> Tensor:
        """Convolve; each output plane sees three input planes, joined along the channels."""
        count = volume.shape[2]
        padded = F.pad(volume.permute(2, 0, 1, 3, 4), (0, 0, 0, 0, 0, 0, 0, 0, 1, 1))
        three = torch.cat([padded[k : k + count : self.step] for k in range(3)], dim=2)
        return torch.unflatten(self.flat(three.flatten(0, 1)), 0, (three.shape[0], -1)).permute(1, 2, 0, 3, 4)


class PlaneConvTranspose(nn.Module):
    """A transposed 3x3x3 convolution that doubles a volume [N, C, D, h, w].

    Its even output planes come from the middle of the kernel and one input plane, the odd ones from both ends of the
    kernel and two.
    """

    def __init__(self, source: nn.ConvTranspose3d) -> None:
        super().__init__()
        shape = source.kernel_size, source.stride, source.padding, source.output_padding
        if shape != (KERNEL, (2, 2, 2), (1, 1, 1), (1, 1, 1)):
            raise InvalidArgument("source", "must be 3x3x3 with stride 2 and paddings 1", source)
        weight, with_bias = source.weight.detach(), source.bias is not None
        kernels = weight[:, :, 1], torch.cat([weight[:, :, 2], weight[:, :, 0]])
        self.even, self.odd = (
            nn.ConvTranspose2d(len(kernel), source.out_channels, 3, 2, 1, 1, bias=with_bias) for kernel in kernels
        )
        for half, kernel in zip((self.even, self.odd), kernels, strict=True):
            half.weight = nn.Parameter(kernel)
            half.bias = source.bias

    def forward(self, volume: Tensor) -> Tensor:
        """Double depth, height and width."""
        planes = volume.permute(2, 0, 1, 3, 4)
        count = planes.shape[0]
        after = F.pad(planes[1:], (0, 0, 0, 0, 0, 0, 0, 0, 0, 1))
        even = self.even(planes.flatten(0, 1))
        odd = self.odd(torch.cat([planes, after], dim=2).flatten(0, 1))
        both = torch.stack([torch.unflatten(half, 0, (count, -1)) for half in (even, odd)], dim=1)
        return both.flatten(0, 1).permute(1, 2, 0, 3, 4)


def planes_for_volumes(network: nn.Module) -> None:
    """Replace every 3-D convolution of a network by its 2-D form, in place."""
    for name, child in list(network.named_children()):
        if isinstance(child, nn.Conv3d):
            setattr(network, name, PlaneConv(child))
        elif isinstance(child, nn.ConvTranspose3d):
            setattr(network, name, PlaneConvTranspose(child))
        else:
            planes_for_volumes(child)


def fold_batch_norms(network: nn.Module) -> None:
    """Fold each batch norm that follows a convolution in a sequence into it, in place; in evaluation mode only."""
    for child in network.children():
        slots = list(_slots(child)) if isinstance(child, nn.Sequential) else []
        for (owner, index), (next_owner, next_index) in pairwise(slots):
            first, second = owner[index], next_owner[next_index]
            if isinstance(first, CONVOLUTIONS) and isinstance(second, nn.BatchNorm2d | nn.BatchNorm3d):
                transposed = isinstance(first, nn.ConvTranspose3d)
                owner[index] = nn.utils.fusion.fuse_conv_bn_eval(first, second, transpose=transposed)
                next_owner[next_index] = nn.Identity()
        for part in [owner[index] for owner, index in slots] or [child]:
            fold_batch_norms(part)


def _slots(sequence: nn.Sequential) -> Iterator[tuple[nn.Sequential, int]]:
    """Name the places of a sequence in order, those of sequences inside it among them."""
    for index, part in enumerate(sequence):
        if isinstance(part, nn.Sequential):
            yield from _slots(part)
        else:
            yield sequence, index
