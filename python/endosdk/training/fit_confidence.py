"""Fit the confidence to the errors that a trained network really makes."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument
from endosdk.training.data import Crops, has_truth
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.survey import LARGEST_ERROR, answered_crops
from endosdk.training.validation import predict_frames

PIXELS_PER_FRAME = 20_000
CROPS_PER_PAIR = 2


def fit_laplace(evidence: Tensor, error: Tensor) -> Tensor:
    """Return the weights (constant first) that make log b = weights . (1, evidence) most likely.

    ``evidence`` [M, K], ``error`` [M] in px, of either sign. Minimises the mean of |error| / b + log b, which is convex
    in the weights, so there is one answer.
    """
    if evidence.ndim != 2 or error.shape != evidence.shape[:1] or len(error) <= evidence.shape[1]:
        raise InvalidArgument("evidence", "must be [M, K] with more rows than columns, one error each", evidence.shape)
    size = error.double().abs().clamp_min(1e-6)
    # Columns are brought to mean 0 and spread 1, for the sake of the search; the weights are turned back at the end.
    centre, spread = evidence.double().mean(dim=0), evidence.double().std(dim=0).clamp_min(1e-6)
    columns = torch.cat([torch.ones(len(size), 1, dtype=torch.float64), (evidence.double() - centre) / spread], dim=1)
    weights = torch.zeros(columns.shape[1], dtype=torch.float64, requires_grad=True)
    with torch.no_grad():
        weights[0] = math.log(float(size.mean()))
    search = torch.optim.LBFGS([weights], max_iter=200, tolerance_grad=1e-9, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        search.zero_grad()
        log_scale = columns @ weights
        value = (size * torch.exp(-log_scale) + log_scale).mean()
        value.backward()  # type: ignore[no-untyped-call]
        return value

    search.step(loss)  # type: ignore[no-untyped-call]
    fitted = weights.detach()
    slopes = fitted[1:] / spread
    return torch.cat([fitted[:1] - (slopes * centre).sum(), slopes]).float()


def fit_confidence(
    network: StereoNetwork, reader: DatasetReader, indices: list[int], seed: int = 0, *, spoilt: Crops | None = None
) -> None:
    """Fit the network's confidence, in place, on pairs that it was not trained on.

    Pixels that only one camera sees count too: doubt there is what the confidence is for. ``spoilt`` are crops of such
    pairs as training spoils them; they count as much as the whole pairs.
    """
    if not indices:
        raise InvalidArgument("held_out", "must leave at least one pair to fit the confidence on", 0)
    # Twice: where the answer is upsampled by its confidence, the errors depend a little on the fit.
    for _ in range(2):
        evidence, error = _evidence_and_error(network, reader, indices, seed)
        if spoilt is not None:
            more, further = _of_crops(network, spoilt, seed, len(error))
            evidence, error = torch.cat([evidence, more]), torch.cat([error, further])
        network.confidence.weights.copy_(fit_laplace(evidence, error.clamp(-LARGEST_ERROR, LARGEST_ERROR)))


@torch.no_grad()
def _of_crops(network: StereoNetwork, crops: Crops, seed: int, most: int) -> tuple[Tensor, Tensor]:
    """Do what `_evidence_and_error` does with crops, for at most so many answers."""
    evidence, error = [], []
    device = network.confidence.weights.device
    for one in answered_crops(network, crops, CROPS_PER_PAIR * len(crops.indices), seed):
        clues = None if one.clues is None else one.clues.to(device)
        columns = network.confidence.columns(one.evidence.to(device), clues)[0].cpu()
        known = one.known > 0
        evidence.append(columns.expand(len(one.error), -1, -1, -1).permute(0, 2, 3, 1)[known])
        error.append(one.error[known])
    chosen = torch.randperm(sum(map(len, error)), generator=torch.Generator().manual_seed(seed))[:most]
    return torch.cat(evidence)[chosen], torch.cat(error)[chosen]


@torch.no_grad()
def _evidence_and_error(
    network: StereoNetwork, reader: DatasetReader, indices: list[int], seed: int
) -> tuple[Tensor, Tensor]:
    """Draw pixels with truth: what the network knew [M, K], and its error [M], px that it saw."""
    rng = np.random.default_rng(seed)
    evidence, error = [], []
    for frame in predict_frames(network, reader, indices, title="confidence"):
        truth = frame.sample.disparity
        # Beyond the range the deployed network gives no answer.
        known = np.flatnonzero(has_truth(torch.from_numpy(truth / frame.reduction), network.max_disparity))
        chosen = rng.choice(known, size=min(PIXELS_PER_FRAME, len(known)), replace=False)
        evidence.append(frame.columns.flatten(1)[:, chosen].T)
        # In pixels that the network saw: what the confidence promises is an error on its own grid.
        error.append(torch.from_numpy((frame.maps[-1] - truth).ravel()[chosen] / frame.reduction))
    return torch.cat(evidence), torch.cat(error)
