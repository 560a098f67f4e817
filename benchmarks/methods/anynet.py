"""AnyNet: Wang, Lai, Huang, Wang, Yan, Campbell, Weinberger: "Anytime Stereo Image Depth Estimation on Mobile Devices",
ICRA 2019. All four stages: disparity at 1/16, residuals at 1/8 and 1/4, spatial propagation at 1/4.

Sizes follow the description: features of 8, 4 and 2 channels by a small U-Net that enlarges bilinearly, L1 volumes with
one channel, six 3-D convolutions a stage (16 channels at 1/16, 4 below), residuals of -2..2 px of the stage. The gates
of the propagation are always normalised, and it starts to learn late. Ours: rectified output, as the model file wants,
and a propagation in 32-bit floats whatever the rest takes: 16 bits know a disparity of 64 px to half a pixel.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.methods.propagation import Propagation
from benchmarks.methods.published import PublishedNetwork, Stages, column_index, enlarge, exactly, he_normal
from endosdk.training.networks.base import check_max_disparity
from endosdk.training.networks.blocks import scaled_colours
from endosdk.training.networks.cost_volume import SoftArgmin, match_evidence, soft_argmin

CELLS = (16, 8, 4)  # input pixels per cell of each stage
RESIDUAL = 2  # largest correction of a stage, in its cells
SPREAD = 8  # channels that the propagation carries


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1, dims: int = 2) -> nn.Sequential:
    """Batch norm and rectifier before the convolution."""
    norm, conv = (nn.BatchNorm2d, nn.Conv2d) if dims == 2 else (nn.BatchNorm3d, nn.Conv3d)
    return nn.Sequential(norm(inputs), nn.ReLU(), conv(inputs, outputs, kernel, stride, kernel // 2, bias=False))


class _Up(nn.Module):
    """One step up of the U-Net."""

    def __init__(self, deep: int, skipped: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(_conv(deep + skipped, skipped), _conv(skipped, skipped))

    def forward(self, deep: Tensor, skipped: Tensor) -> Tensor:
        # With the corners aligned, as the authors have it.
        larger = F.interpolate(deep, size=skipped.shape[-2:], mode="bilinear", align_corners=True)
        out: Tensor = self.mix(torch.cat([skipped, larger], dim=1))
        return out


class _Features(nn.Module):
    """Features at 1/16, 1/8 and 1/4."""

    def __init__(self) -> None:
        super().__init__()
        self.quarter = nn.Sequential(
            nn.Conv2d(3, 1, 3, padding=1), _conv(1, 1, stride=2), nn.MaxPool2d(2), _conv(1, 2), _conv(2, 2)
        )
        self.eighth = nn.Sequential(nn.MaxPool2d(2), _conv(2, 4), _conv(4, 4))
        self.sixteenth = nn.Sequential(nn.MaxPool2d(2), _conv(4, 8), _conv(8, 8))
        self.up_eighth, self.up_quarter = _Up(8, 4), _Up(4, 2)

    def forward(self, colours: Tensor) -> list[Tensor]:
        quarter = self.quarter(colours)
        eighth = self.eighth(quarter)
        sixteenth = self.sixteenth(eighth)
        eighth = self.up_eighth(sixteenth, eighth)
        return [sixteenth, eighth, self.up_quarter(eighth, quarter)]


class _Spatial(nn.Module):
    """The fourth stage: a disparity that flows along rows where the colours of the left view let it."""

    def __init__(self) -> None:
        super().__init__()
        wide = 2 * SPREAD
        self.gates = nn.Sequential(
            nn.Conv2d(3, wide, 3, padding=1, bias=False),
            *(layer for _ in range(2) for layer in (nn.ReLU(), nn.Conv2d(wide, wide, 3, padding=1, bias=False))),
            nn.ReLU(),
            nn.Conv2d(wide, 3 * SPREAD, 3, padding=1, bias=False),
        )
        self.spread = nn.Conv2d(1, SPREAD, 3, padding=1, bias=False)
        self.propagation = Propagation()
        self.gather = nn.Conv2d(SPREAD, 1, 3, padding=1, bias=False)

    def forward(self, disparity: Tensor, colours: Tensor) -> Tensor:
        with exactly(disparity):
            out: Tensor = self.gather(self.propagation(self.spread(disparity), self.gates(colours)))
        return out


class AnyNet(PublishedNetwork):
    """The four-stage network; its last stage is its answer."""

    name = "anynet"
    input_multiple = 16
    stage_weights = (0.25, 0.5, 1.0, 1.0)

    def __init__(self, max_disparity: int = 80) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 16."""
        super().__init__()
        self.max_disparity = check_max_disparity(max_disparity, CELLS[0])
        self.features = _Features()
        self.costs = nn.ModuleList(
            nn.Sequential(_conv(1, c, dims=3), *(_conv(c, c, dims=3) for _ in range(4)), _conv(c, 1, dims=3))
            for c in (16, 4, 4)
        )
        self.refinement = _Spatial()  # by this name the loop knows what learns late
        he_normal(self)

    def stages(self, left: Tensor, right: Tensor, late: bool = True) -> Stages:
        """Match in three stages, then propagate."""
        pairs = left.shape[0]
        colours = scaled_colours(torch.cat([left, right]))
        levels = [(f[:pairs], f[pairs:]) for f in self.features(colours)]
        found = soft_argmin(self._cost(0, _absolute_volume(*levels[0], self.max_disparity // CELLS[0])))
        maps = [enlarge(found.disparity, left) * CELLS[0]]
        for stage in (1, 2):
            start = enlarge(maps[-1], levels[stage][0]) / CELLS[stage]
            found = soft_argmin(self._cost(stage, _residual_volume(*levels[stage], start)))
            step = found.disparity - RESIDUAL
            maps.append(maps[-1] + enlarge(step, left) * CELLS[stage])
            found = SoftArgmin(start + step, found.excess)
        if late:
            quarter = enlarge(maps[-1], levels[2][0])
            maps.append(torch.relu(enlarge(self.refinement(quarter, enlarge(colours[:pairs], quarter)), left)))
        return Stages(maps, enlarge(match_evidence(found, CELLS[2]), left))

    def _cost(self, stage: int, volume: Tensor) -> Tensor:
        """Filter a volume [N, D, h, w] into cost [N, h, w, D]."""
        cost: Tensor = self.costs[stage](volume.unsqueeze(1))
        return cost.squeeze(1).permute(0, 2, 3, 1)


def _absolute_volume(left: Tensor, right: Tensor, planes: int) -> Tensor:
    """L1 distance of features for shifts of 0 to planes - 1 cells, [N, D, h, w]; against zero beyond the picture."""
    width = right.shape[-1]
    padded = F.pad(right, (planes - 1, 0))
    shifted = [padded[..., planes - 1 - plane : planes - 1 - plane + width] for plane in range(planes)]
    return torch.stack([(left - other).abs().sum(dim=1) for other in shifted], dim=1)


def _residual_volume(left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
    """L1 distance for shifts around a disparity [N, 1, h, w] in cells: -RESIDUAL..RESIDUAL, [N, D, h, w].

    The right features are read between columns, linearly; they are zero beyond the picture. All shifts lie equally far
    from the column beside them, so neighbouring shifts share what they read.
    """
    width = right.shape[-1]
    place = column_index(disparity) - disparity
    floor = place.detach().floor()
    share = (place - floor).unsqueeze(2)
    offsets = torch.arange(RESIDUAL + 1, -RESIDUAL - 1, -1, device=right.device).view(1, -1, 1, 1)
    columns = (floor.long() + offsets).unsqueeze(1)
    inside = ((columns >= 0) & (columns < width)).to(right.dtype)
    size = (-1, right.shape[1], columns.shape[2], -1, -1)
    read = torch.gather(right.unsqueeze(2).expand(size), 4, columns.clamp(0, width - 1).expand(size)) * inside
    moved = read[:, :, 1:] * (1.0 - share) + read[:, :, :-1] * share
    return (left.unsqueeze(2) - moved).abs().sum(dim=1)
