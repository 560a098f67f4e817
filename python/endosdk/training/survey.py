"""Teach the `Surveyor` of a network's confidence what the clues say about errors.

The network stays as it is. It answers crops as training draws them, spoilt looks included. What it knew of each cell
and how far it was off are kept, and the surveyor learns from these. A surveyor is too small to learn crops by heart,
so it may see the pairs that the network has learned from; the scale is fitted to others
(`fit_confidence`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from endosdk.io.progress import progress
from endosdk.training.data import Crops, has_truth
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.networks.confidence import ConfidenceHead, Surveyor

MOST_CROPS = 1200
EPOCHS = 6  # through them
RATE, DECAY = 3e-3, 1e-3
LARGEST_ERROR = 30.0  # px; beyond it more is not worse


class Known(NamedTuple):
    """What a network knew of the cells of one crop, and how far it was off."""

    evidence: Tensor  # [1, K, h, w]
    clues: Tensor | None  # [1, C, h, w]
    error: Tensor  # [r^2, h, w], px: of one pixel in each answer of the cell
    known: Tensor  # the same, whether there is truth


def answered_crops(network: StereoNetwork, crops: Crops, count: int, seed: int) -> Iterator[Known]:
    """Answer the first ``count`` crops; the network is left in evaluation mode."""
    device = next(network.parameters()).device
    stride, factor = network.output_stride, network.coarse_stride // network.output_stride
    network.eval()
    rng = np.random.default_rng([seed, 3])
    for item in progress(range(count), title="confidence", unit="crop", stays=False):
        left, right, truth = (part[None].to(device, torch.float32) for part in crops[item])
        with torch.no_grad():
            prediction = network(left, right)
            row, column = rng.integers(0, stride, size=2)
            wanted = truth[..., row::stride, column::stride]
            mask = has_truth(wanted, network.max_disparity)
            error = (prediction.disparities[-1] - wanted).where(mask, 0.0)
            cells = (F.pixel_unshuffle(part, factor)[0].cpu() for part in (error, mask.float()))
            clues = None if prediction.clues is None else prediction.clues.cpu()
            yield Known(prediction.evidence.cpu(), clues, *cells)


def teach_surveyor(network: StereoNetwork, crops: Crops, count: int, seed: int = 0) -> None:
    """Let the surveyor of the network's confidence, which must have one, learn from ``count`` crops; in place."""
    # In 16 bits: a thousand crops are to fit into memory.
    answers = [
        one._replace(evidence=one.evidence.half(), clues=None if one.clues is None else one.clues.half())
        for one in answered_crops(network, crops, count, seed)
    ]
    learn(network.confidence, answers, EPOCHS * len(answers), seed)


def learn(head: ConfidenceHead, answers: list[Known], steps: int, seed: int) -> None:
    """Let the surveyor of ``head`` take so many steps of one answer each; the linear part stays as it is."""
    surveyor = head.surveyor
    assert surveyor is not None
    device = head.weights.device
    _measure(surveyor, [_joined(one) for one in answers])
    surveyor.requires_grad_(True)
    search = torch.optim.AdamW(surveyor.parameters(), RATE, weight_decay=DECAY)
    rates = torch.optim.lr_scheduler.OneCycleLR(search, RATE, total_steps=max(steps, 2))
    rng = np.random.default_rng([seed, 4])
    for _ in progress(range(steps), title="confidence", unit="step", stays=False):
        one = answers[int(rng.integers(len(answers)))]
        loss = _unlikeliness(head, *(part.to(device, torch.float32) for part in one if part is not None))
        search.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        search.step()
        rates.step()
    surveyor.requires_grad_(False)


def _joined(one: Known) -> Tensor:
    assert one.clues is not None
    return torch.cat([one.evidence, one.clues], dim=1)


def _measure(surveyor: Surveyor, seen: list[Tensor]) -> None:
    """Keep mean and spread of every channel, so that all count alike at the start."""
    some = torch.cat([part[0].flatten(1)[:, ::17].float() for part in seen], dim=1)
    surveyor.get_buffer("mean").copy_(some.mean(dim=1).view(1, -1, 1, 1))
    surveyor.get_buffer("spread").copy_(some.std(dim=1).clamp_min(1e-3).view(1, -1, 1, 1))


def _unlikeliness(head: ConfidenceHead, evidence: Tensor, clues: Tensor, error: Tensor, known: Tensor) -> Tensor:
    """Minus the logarithm of how likely the errors are, and of how likely it is that they lie within a pixel or not."""
    log_scale = head.scale_of(head.columns(evidence, clues))[0].expand_as(error)[known > 0]
    size = error[known > 0].abs().clamp_max(LARGEST_ERROR)
    if not len(size):
        return log_scale.sum()
    within = F.binary_cross_entropy(head(log_scale).clamp(1e-5, 1 - 1e-5), (size <= 1.0).float())
    return (size * torch.exp(-log_scale) + log_scale).mean() + within
