"""What the confidence reads: evidence of a bad match, what the refinement changed, and clues from around."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.comparison import CELL, DISPARITY_HINT, FINE, HINTS, largest_around
from endosdk.training.networks.cost_volume import SoftArgmin, match_evidence

WIDE_UNIT = 4.0  # planes; in this unit disparities are about as large as the other hints
NEARBY = 5, 13  # cells, along each axis, within which the confidence looks for jumps of the disparity
DOUBTS = 2  # channels of evidence that the refinement adds
CLUES = HINTS - 1 + 2 + len(NEARBY)  # channels that the confidence reads besides its evidence


class MatchEvidence(nn.Module):
    """`match_evidence` of a disparity in planes that are ``cell`` px apart."""

    def __init__(self, cell: int) -> None:
        super().__init__()
        self.cell = cell

    @property
    def attributes(self) -> dict[str, float]:
        """What the function of a model file says of itself."""
        return {"cell": float(self.cell)}

    def forward(self, disparity: Tensor, excess: Tensor) -> tuple[Tensor]:
        """Map disparity, planes, and excess [N, 1, h, w] to evidence [N, 2, h, w]."""
        return (match_evidence(SoftArgmin(disparity, excess), self.cell),)


class AnswerClues(NamedTuple):
    """What an answer adds to the evidence, and what the confidence reads besides it, on the coarse grid."""

    doubts: Tensor  # [N, DOUBTS, h, w]
    clues: Tensor  # [N, CLUES, h, w]


class CluesOfAnswer(nn.Module):
    """How far a refinement moved the answer, the hints that it had, and how the disparity jumps around."""

    @property
    def attributes(self) -> dict[str, float]:
        """What the function of a model file says of itself."""
        return {"unit": CELL * WIDE_UNIT}

    def forward(self, hints: Tensor, disparity: Tensor, correction: Tensor, change: Tensor) -> AnswerClues:
        """Map what the refinement read and gave to clues.

        Hints [N, HINTS, h, w], disparity [N, 1, h, w] and correction [N, FINE^2, h, w] are on the coarse grid, the
        change [N, 1, h FINE, w FINE] on that of the answer; all but the hints in px.
        """
        doubts = [log_largest(correction), log_largest(F.max_pool2d(change.abs(), FINE))]
        return AnswerClues(torch.cat(doubts, dim=1), clues_of(hints, disparity))


def log_largest(change: Tensor) -> Tensor:
    """Return the logarithm [N, 1, h, w] of the largest change [N, C, h, w], px, within each cell."""
    return torch.log(change.detach().abs().amax(dim=1, keepdim=True) + 0.05)


def clues_of(hints: Tensor, disparity: Tensor) -> Tensor:
    """Return what the confidence reads besides its evidence, of the hints and of a disparity [N, 1, h, w], px."""
    hints, disparity = hints.detach(), disparity.detach()
    around = surface_clues(disparity / (CELL * WIDE_UNIT))
    return torch.cat([hints[:, :DISPARITY_HINT], *around, hints[:, DISPARITY_HINT + 1 :]], dim=1)


def surface_clues(disparity: Tensor) -> list[Tensor]:
    """Give clues [N, 1, h, w] from a disparity map: itself, what stands out in front of it, and jumps around."""
    around = [(largest_around(disparity, reach), -largest_around(-disparity, reach)) for reach in NEARBY]
    return [disparity, around[0][0] - disparity, *(torch.log(near - far + 0.02) for near, far in around)]
