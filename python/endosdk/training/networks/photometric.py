"""Sub-pixel disparity from the pictures themselves: one step of Lucas and Kanade along the rows.

Features on a coarse grid match to a fraction of a cell and keep a bias that depends on where between two planes the
answer lies. The pictures know better: where the right view, moved by a disparity d that is nearly right, still differs
from the left one, the difference divided by the slope of the picture is what d lacks (B. D. Lucas and T. Kanade,
"An iterative image registration technique", IJCAI 1981). The mean difference within a window is taken out first, so
that two cameras of unlike brightness agree.

Two uses of it are here. `step` solves within windows and leaves it to a network to say where it is to be believed;
`likely_step` needs no network: it shrinks every step by how well the pictures determine it.

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
DOUBT = 0.1  # 1/px^2, of `likely_step`: one over the variance of what a disparity lacks, times the samples of a cell
LIKELY_STEP = 0.5  # px; more is seldom lacking, and rarely right
LEAST_SHARED = 1e-3  # mean share below which a neighbourhood has nothing to say


class Step(NamedTuple):
    """What one window says."""

    step: Tensor  # [N, 1, h, w], px, to be added to the disparity
    spread: Tensor  # [N, 2, h, w]: `texture` and `mismatch`

    @property
    def texture(self) -> Tensor:
        """Logarithm of the variance of the slope, over `LOG_UNIT`: how well the step is known."""
        return self.spread[:, :1]

    @property
    def mismatch(self) -> Tensor:
        """Logarithm of the variance of the difference, over `LOG_UNIT`: how unlike the views are."""
        return self.spread[:, 1:]


def brightness(views: Tensor) -> Tensor:
    """Map views [N, 3, H, W], 0..255, to brightness on pairs of rows [N, 1, H/2, W]."""
    # One axis after the other: runtimes take a third of the time of a mean over both at once.
    rows = torch.unflatten(views.sum(dim=1, keepdim=True), 2, (-1, ROWS))
    return rows.sum(dim=3) * (1.0 / (3 * ROWS * UNIT))


def moments(left: Tensor, right: Tensor, disparity: Tensor, cell: int) -> Tensor:
    """Compare brightness [N, 1, H/2, W] of both views at a disparity [N, 1, h, w], px, of any coarser grid.

    Give means [N, 5, H/cell, W/cell] over cells of ``cell`` x ``cell`` pixels of the views: the slope, the difference
    of the views, their product, and the squares of both.
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
    return F.avg_pool2d(torch.cat(products, dim=1), (cell // ROWS, cell))


def step(means: Tensor, window: int) -> Step:
    """Solve for the step within windows of ``window`` x ``window`` cells, an odd number, around every cell.

    ``means`` [N, 5, h, w] are those of `moments`, or means of them on larger cells.
    """
    if window > 1:
        means = F.avg_pool2d(means, window, 1, window // 2, count_include_pad=False)
    # As few operations as can be, on maps together: runtimes take longer to begin one than to compute it.
    first, product, second = torch.split(means, [2, 1, 2], dim=1)
    slope, difference = torch.split(first, 1, dim=1)
    variance = (second - first * first).clamp_min(0.0)
    solved = (slope * difference - product) / (variance[:, :1] + DAMPING)
    spread = torch.log(variance + QUIET) / LOG_UNIT
    return Step(solved.clamp(-LARGEST_STEP, LARGEST_STEP), spread)


def likely_step(means: Tensor) -> Tensor:
    """Give the step that is likely for every cell, [N, 1, h, w], px, to be added to a disparity that is nearly right.

    Where what the disparity lacks and what else differs between the views are both normal, the likeliest step is that
    of least squares with a damping in proportion to the variance of the difference: little texture or much noise,
    little step. Cells are solved one by one, so that a highlight spoils no other, and then averaged over their
    neighbours, because what a smooth surface lacks is much the same next door. There each counts by how much of its
    contrast both views share, so that flat and occluded cells follow those around them.

    ``means`` [N, 5, h, w] are those of `moments`, in cells of the size at which the disparity was matched.
    """
    first, product, second = torch.split(means, [2, 1, 2], dim=1)
    slope, difference = torch.split(first, 1, dim=1)
    texture, mismatch = torch.split((second - first * first).clamp_min(0.0), 1, dim=1)
    noise = mismatch + QUIET
    solved = (slope * difference - product) / (texture + DOUBT * noise)
    shared = texture / (texture + noise)
    both = torch.cat([shared * solved.clamp(-LIKELY_STEP, LIKELY_STEP), shared], dim=1)
    # Twice a mean of 2 x 2: weights 1, 2, 1 along both axes.
    framed = F.pad(both, (1, 1, 1, 1), mode="replicate")
    steps, counts = torch.split(F.avg_pool2d(F.avg_pool2d(framed, 2, 1), 2, 1), 1, dim=1)
    return steps / counts.clamp_min(LEAST_SHARED)
