"""Losses between a predicted and a true disparity map: pure functions of two maps and a mask.

All take ``predicted`` and ``truth`` [N, 1, H, W] in pixels and a boolean ``mask`` of the same shape, true where there
is truth (elsewhere the truth may hold anything, NaN too). The loss is computed per pair and averaged over the pairs
that have at least one pixel of truth; a batch without any truth has loss 0 and gradient 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor

from endosdk.errors import InvalidArgument

SMALLEST_DISPARITY = 0.1  # px; the logarithm is cut here, so its gradient stays below 10 per pixel


def scale_invariant_loss(predicted: Tensor, truth: Tensor, mask: Tensor, balance: float = 0.5) -> Tensor:
    """Return mean(d^2) - balance * mean(d)^2 of d = log predicted - log truth.

    ``balance`` 0 is the plain square in log space, 1 ignores a common factor between the maps; the paper takes 0.5.
    """
    # Outside the mask both logarithms are of the same constant: no NaN can leak into a gradient.
    logs = [torch.where(mask, m, 1.0).clamp_min(SMALLEST_DISPARITY).log() for m in (predicted, truth)]
    difference = logs[0] - logs[1]
    count = _count(mask)
    square = difference.square().sum(dim=(1, 2, 3)) / count
    mean = difference.sum(dim=(1, 2, 3)) / count
    return _over_pairs(square - balance * mean.square(), mask)


def l2_loss(predicted: Tensor, truth: Tensor, mask: Tensor) -> Tensor:
    """Return the mean squared error, px^2."""
    square = _difference(predicted, truth, mask).square()
    return _over_pairs(square.sum(dim=(1, 2, 3)) / _count(mask), mask)


def l1_loss(predicted: Tensor, truth: Tensor, mask: Tensor) -> Tensor:
    """Return the mean absolute error, px: what the end-point error measures."""
    error = _difference(predicted, truth, mask).abs()
    return _over_pairs(error.sum(dim=(1, 2, 3)) / _count(mask), mask)


def smooth_l1_loss(predicted: Tensor, truth: Tensor, mask: Tensor) -> Tensor:
    """Return the mean of e^2 / 2 below one pixel of error and e - 1/2 above: robust where surfaces end."""
    error = _difference(predicted, truth, mask)
    cost = F.smooth_l1_loss(error, torch.zeros_like(error), reduction="none")
    return _over_pairs(cost.sum(dim=(1, 2, 3)) / _count(mask), mask)


def volume_cross_entropy(cost: Tensor, truth: Tensor, mask: Tensor, candidates: Tensor) -> Tensor:
    """Return the cross-entropy between the distribution over candidates and that of the truth under each cell.

    ``cost`` [N, D, r^2, h, w] as `Prediction.cost`; ``candidates`` [D], px. The truth of a cell is the mean of one
    Laplace law for every pixel of it, so a cell across an edge has two peaks, and the answer is asked to be one of them
    rather than a surface between (P. Xu et al., "Adaptive Multi-Modal Cross-Entropy Loss for Stereo Matching", CVPR
    2024, in the simple form that weighs pixels alike). The law's scale is half of what lies between the two candidates
    around. Two pixels in each direction stand for the cell's.
    """
    count, planes, cells, _, width = cost.shape
    cell = truth.shape[-1] // (width * math.isqrt(cells))
    inside = slice(cell // 4, None, cell // 2)
    samples, known = (F.pixel_unshuffle(part[..., inside, inside], 2) for part in (truth, mask.to(cost)))
    samples = torch.where(known > 0, samples, 0.0)
    gaps = candidates[1:] - candidates[:-1]
    scales = gaps[torch.bucketize(samples, candidates[1:-1])] / 2.0
    law = torch.softmax(-(samples.unsqueeze(2) - candidates.view(-1, 1, 1)).abs() / scales.unsqueeze(2), dim=2)
    pixels = known.sum(dim=1)
    wanted = (law * known.unsqueeze(2)).sum(dim=1) / pixels.clamp_min(1.0).unsqueeze(1)
    side = math.isqrt(cells)
    logs = torch.log_softmax(-cost.float(), dim=1)
    logs = torch.unflatten(F.pixel_shuffle(logs.flatten(0, 1), side), 0, (count, planes)).squeeze(2)
    per_cell = -(wanted * logs).sum(dim=1, keepdim=True)
    # What the truth itself leaves open is no fault: without it a perfect volume has loss 0.
    per_cell = per_cell + (wanted * torch.log(wanted.clamp_min(1e-12))).sum(dim=1, keepdim=True)
    some = (pixels > 0).unsqueeze(1)
    return _over_pairs(torch.where(some, per_cell, 0.0).sum(dim=(1, 2, 3)) / _count(some), some)


def build_loss(name: str, balance: float = 0.5) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
    """Return the named loss; ``balance`` counts for the scale-invariant one alone."""
    losses: dict[str, Callable[[Tensor, Tensor, Tensor], Tensor]] = {
        "scale-invariant": lambda predicted, truth, mask: scale_invariant_loss(predicted, truth, mask, balance),
        "l1": l1_loss,
        "l2": l2_loss,
        "smooth-l1": smooth_l1_loss,
    }
    if name not in losses:
        raise InvalidArgument("loss", f"must be one of {', '.join(sorted(losses))}", name)
    return losses[name]


def _difference(predicted: Tensor, truth: Tensor, mask: Tensor) -> Tensor:
    return torch.where(mask, predicted, 0.0) - torch.where(mask, truth, 0.0)


def _count(mask: Tensor) -> Tensor:
    return mask.sum(dim=(1, 2, 3)).clamp_min(1)


def _over_pairs(per_pair: Tensor, mask: Tensor) -> Tensor:
    with_truth = mask.any(dim=3).any(dim=2).any(dim=1)
    return (per_pair * with_truth).sum() / with_truth.sum().clamp_min(1)
