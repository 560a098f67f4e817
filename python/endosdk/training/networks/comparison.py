"""What the pictures themselves say at a disparity, and what a refinement makes of it."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.photometric import moments, step

CELL = 4  # input pixels per cell of the grid on which the views are compared
STRIDE = 2  # input pixels per cell of the answer
FINE = CELL // STRIDE  # cells of the answer along one side of a cell
SMALL, LARGE = 3, 7  # windows, in cells, within which the pictures are compared
NEIGHBOURS = 5  # cells, along each axis, among which the nearest and the farthest surface are looked for
DISPARITY_HINT = 3 * FINE**2 + 3  # which of the hints is the disparity
HINTS = DISPARITY_HINT + 1 + 2 * 4  # channels that tell the refinement what the comparisons gave
SURFACE_UNIT = 16.0  # px; in this unit differences of disparities are about as large as the other hints


class Comparison(NamedTuple):
    """What the views say at a disparity, on the coarse grid."""

    hints: Tensor  # [N, HINTS, h, w]
    steps: Tensor  # [N, FINE^2 + 2, h, w], px: what the pictures ask for, the nearest and the farthest surface around
    spread: Tensor  # [N, 2, h, w], as `photometric.Step`


class CompareViews(nn.Module):
    """Compare the brightness of both views at a disparity, and at the nearest and the farthest one around."""

    def __init__(self) -> None:
        super().__init__()
        self.unit = float(CELL)  # px; of the disparity that the refinement is given

    @property
    def attributes(self) -> dict[str, float]:
        """What the function of a model file says of itself."""
        return {"unit": self.unit}

    def forward(self, bright: Tensor, disparity: Tensor) -> Comparison:
        """Map brightness [2N, 1, H/2, W], left views first, and disparity [N, 1, h, w], px, to what they say."""
        pairs = disparity.shape[0]
        left, right = bright[:pairs], bright[pairs:]
        there = disparity.detach()
        compared = moments(left, right, there, STRIDE)
        cells = F.avg_pool2d(compared, FINE)
        fine, small, large = step(compared, SMALL), step(cells, SMALL), step(cells, LARGE)
        shuffled = unshuffled(torch.cat(fine, dim=1), FINE)
        hints = [shuffled, small.step, small.texture, large.step, disparity / self.unit]
        surfaces = largest_around(there, NEIGHBOURS), -largest_around(-there, NEIGHBOURS)
        for other in surfaces:
            seen = step(moments(left, right, other, CELL), SMALL)
            hints += [(other - disparity) / SURFACE_UNIT, seen.step, seen.spread]
        steps = torch.cat([shuffled[:, : FINE**2], *surfaces], dim=1)
        return Comparison(torch.cat(hints, dim=1), steps, small.spread)


class Choice(NamedTuple):
    """The answer of a refinement, on the grid of the answer, px."""

    answer: Tensor  # [N, 1, h FINE, w FINE], never below 0
    change: Tensor  # likewise: what was added to
    rough: Tensor  # likewise: the disparity that it began with


class ChooseSurface(nn.Module):
    """Choose between the surface found, the nearest and the farthest around, and add what the pictures ask for."""

    def forward(self, correction: Tensor, others: Tensor, disparity: Tensor, steps: Tensor) -> Choice:
        """Map what a refinement gives to its answer.

        The correction [N, FINE^2, h, w] is in px; the others are logits [N, 3 FINE^2, h, w] of the belief in the step
        and of the gates to the nearest and the farthest surface; the rest as in `CompareViews`.
        """
        step_wanted, near, far = torch.split(steps, [FINE**2, 1, 1], dim=1)
        belief, to_near, to_far = torch.split(others, FINE**2, dim=1)
        rough = F.interpolate(disparity, scale_factor=float(FINE), mode="bilinear", align_corners=False)
        change = F.pixel_shuffle(correction + torch.sigmoid(belief) * step_wanted, FINE)
        for gate, surface in ((to_near, near), (to_far, far)):
            there = F.interpolate(surface, scale_factor=float(FINE), mode="nearest")
            change = change + torch.sigmoid(F.pixel_shuffle(gate, FINE)) * (there - rough)
        return Choice(torch.relu(rough + change), change, rough)


def largest_around(values: Tensor, reach: int) -> Tensor:
    """Return the largest value [N, 1, h, w] within a square of ``reach`` cells around each."""
    # Along one axis after the other: runtimes look at every value of a square window.
    rows = F.max_pool2d(values, (reach, 1), 1, (reach // 2, 0))
    return F.max_pool2d(rows, (1, reach), 1, (0, reach // 2))


def unshuffled(values: Tensor, factor: int) -> Tensor:
    """Do what `F.pixel_unshuffle` does, as a convolution: runtimes take a tenth of the time for it."""
    channels = values.shape[1]
    pick = torch.eye(channels * factor**2, dtype=values.dtype, device=values.device)
    return F.conv2d(values, pick.view(-1, channels, factor, factor), stride=factor)
