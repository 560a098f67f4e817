"""Sub-pixel disparity from the pictures themselves: one step of Lucas and Kanade along the rows.

Features on a coarse grid match to a fraction of a cell and keep a bias that depends on where between two planes the
answer lies. The pictures know better: where the right view, moved by a disparity d that is nearly right, still differs
from the left one, the difference divided by the slope of the picture is what d lacks (B. D. Lucas and T. Kanade,
"An iterative image registration technique", IJCAI 1981). The mean difference within a window is taken out first, so
that two cameras of unlike brightness agree.

All sums are taken on pairs of rows, which halves the work; brightness is in units of 64 grey levels, so that its
squares fit into 16-bit floats.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

ROWS = 2  # rows that are averaged before anything else
UNIT = 64.0  # grey levels
DAMPING = 2.0 / UNIT**2  # squared slope below which a window says nothing
LARGEST_STEP = 2.0  # px; the picture is not linear over more
QUIET = 1.0 / UNIT**2  # added under logarithms: noise of one grey level
LOG_UNIT = 4.0  # brings logarithms to the spread of the other channels


class Moments(NamedTuple):
    """Means over the cells of a grid: what the step of any window of cells is made from. Each [N, 1, h, w]."""

    slope: Tensor
    difference: Tensor
    slope_difference: Tensor
    slope_slope: Tensor
    difference_difference: Tensor


class Step(NamedTuple):
    """What one window says. Each [N, 1, h, w]."""

    step: Tensor  # px, to be added to the disparity
    texture: Tensor  # logarithm of the variance of the slope, over `LOG_UNIT`: how well the step is known
    mismatch: Tensor  # logarithm of the variance of the difference, over `LOG_UNIT`: how unlike the views are


def brightness(views: Tensor) -> Tensor:
    """Map views [N, 3, H, W], 0..255, to brightness on pairs of rows [N, 1, H/2, W]."""
    # One axis after the other: runtimes take a third of the time of a mean over both at once.
    rows = torch.unflatten(views.sum(dim=1, keepdim=True), 2, (-1, ROWS))
    return rows.sum(dim=3) * (1.0 / (3 * ROWS * UNIT))


def moments(left: Tensor, right: Tensor, disparity: Tensor, cell: int) -> Moments:
    """Compare brightness [N, 1, H/2, W] of both views at a disparity [N, 1, h, w], px, of any coarser grid.

    The means are over cells of ``cell`` x ``cell`` pixels of the views.
    """
    width = left.shape[-1]
    shift = F.interpolate(disparity, size=left.shape[-2:], mode="bilinear", align_corners=False)
    column = torch.arange(width, dtype=left.dtype, device=left.device)
    position = (column - shift).clamp(0, width - 1)
    # The last column has no right neighbour: it is seen from the one before.
    base = position.floor().clamp_max(width - 2)
    index = base.to(torch.int64)
    near, far = right.gather(3, index), right.gather(3, index + 1)
    moved = near + (position - base) * (far - near)
    both = F.pad(left + moved, (1, 1, 0, 0), mode="replicate")
    slope = (both[..., 2:] - both[..., :-2]) * 0.25
    difference = left - moved
    products = [slope, difference, slope * difference, slope * slope, difference * difference]
    means = F.avg_pool2d(torch.cat(products, dim=1), (cell // ROWS, cell))
    return Moments(*torch.split(means, 1, dim=1))


def coarser(found: Moments, factor: int) -> Moments:
    """Give the means on cells that are ``factor`` times as large."""
    return Moments(*torch.split(F.avg_pool2d(torch.cat(found, dim=1), factor), 1, dim=1))


def step(found: Moments, window: int) -> Step:
    """Solve for the step within windows of ``window`` x ``window`` cells, an odd number, around every cell."""
    means = torch.cat(found, dim=1)
    if window > 1:
        means = F.avg_pool2d(means, window, 1, window // 2, count_include_pad=False)
    slope, difference, slope_difference, slope_slope, difference_difference = torch.split(means, 1, dim=1)
    texture = (slope_slope - slope * slope).clamp_min(0.0)
    mismatch = (difference_difference - difference * difference).clamp_min(0.0)
    solved = (slope * difference - slope_difference) / (texture + DAMPING)
    spread = (torch.log(variance + QUIET) / LOG_UNIT for variance in (texture, mismatch))
    return Step(solved.clamp(-LARGEST_STEP, LARGEST_STEP), *spread)
