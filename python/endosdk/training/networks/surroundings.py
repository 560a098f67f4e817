"""What the surroundings of a cell tell about its disparity."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from endosdk.training.networks.blocks import ConvNorm

DILATIONS = 1, 2, 4, 8, 1  # cells between the taps of each layer: together they see 33 cells, of 8 px


class Surroundings(nn.Module):
    """Convolutions over all planes of a volume together, with the left view beside it, that correct its costs.

    A cell of the volume compares one small window. Where that has no texture, repeats itself, or is hidden from the
    right view, the neighbours know more.
    """

    def __init__(self, volume: int, view: int, channels: int, costs: int) -> None:
        """Map ``volume`` and ``view`` channels, by ``channels`` between, to corrections of so many ``costs``."""
        super().__init__()
        self.volume = ConvNorm(volume, channels, kernel=1, slope=0.0)
        # Apart from the volume, because the two differ in range: together they would share one 8-bit scale.
        self.view = nn.Conv2d(view, channels, 3, stride=2, padding=1, bias=False)
        self.layers = nn.Sequential(*(ConvNorm(channels, channels, dilation=d, slope=0.0) for d in DILATIONS))
        self.last = nn.Conv2d(channels, costs, 1)
        # It starts by correcting nothing, so that weights of a network without it keep their meaning.
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)  # type: ignore[arg-type]

    def seen(self, volume: Tensor, view: Tensor) -> Tensor:
        """Map the volume [N, volume, h, w] and the view [N, view, 2h, 2w] to what was seen, [N, channels, h, w]."""
        out: Tensor = self.layers(self.volume(volume, added=self.view(view)))
        return out

    def forward(self, volume: Tensor, view: Tensor) -> Tensor:
        """Return the corrections [N, costs, h, w]; inputs as of `seen`."""
        out: Tensor = self.last(self.seen(volume, view))
        return out

    @staticmethod
    def with_planes(weights: dict[str, Tensor], old: Sequence[int], new: Sequence[int]) -> dict[str, Tensor]:
        """Return weights made for the ``old`` planes in the form for the ``new`` ones, each taken from the nearest."""
        nearest = [min(range(len(old)), key=lambda index: abs(old[index] - shift)) for shift in new]
        share = torch.tensor([1.0 / nearest.count(index) for index in nearest])
        read = torch.unflatten(weights["volume.conv.weight"], 1, (len(old), -1))[:, nearest]
        changed = {"volume.conv.weight": (read * share.view(1, -1, 1, 1, 1)).flatten(1, 2)}
        for name in ("last.weight", "last.bias"):
            changed[name] = torch.unflatten(weights[name], 0, (len(old), -1))[nearest].flatten(0, 1)
        return weights | changed

    def product(self, order: Tensor) -> tuple[Tensor, Tensor]:
        """Return the last layer as a matrix [channels, costs] and what it adds [costs], outputs in this order."""
        assert self.last.bias is not None
        return self.last.weight.detach()[order, :, 0, 0].t().contiguous(), self.last.bias.detach()[order]
