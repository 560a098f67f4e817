"""How far a disparity can be trusted, as a calibrated probability."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.blocks import enlarged

HIDDEN = 8  # channels; few, because they are computed in floats
DISTANCES = 1, 2, 4  # cells, between the taps of the layers that look around
LARGEST_LOG = 4.6  # b is kept within 0.01 and 100 px


class ConfidenceHead(nn.Module):
    """Turn evidence into the probability that the disparity is wrong by at most one pixel.

    The error is taken to follow a Laplace law whose scale b depends on the evidence: log b is linear in the logarithms
    of what the network knows about its own answer, and in what `Surveyor` makes of the clues around, where there are
    any. Nothing of it learns along with the network; it is fitted afterwards (`endosdk.training.fit_confidence`).
    """

    weights: Tensor

    def __init__(self, channels: int, clues: int = 0) -> None:
        """Read evidence of so many ``channels``, and so many channels of ``clues``."""
        super().__init__()
        self.surveyor = Surveyor(channels + clues) if clues else None
        # Before calibration: b grows with the square root of the first channel, which holds a variance.
        start = torch.zeros(1 + channels)
        start[1] = 0.5
        if clues:
            start = torch.cat([start, torch.ones(1)])
        self.register_buffer("weights", start)

    def columns(self, evidence: Tensor, clues: Tensor | None) -> Tensor:
        """Return what log b is linear in, [N, K, H, W], of the evidence and the clues."""
        if self.surveyor is None or clues is None:
            return evidence
        return torch.cat([evidence, self.surveyor(torch.cat([evidence, clues], dim=1))], dim=1)

    def scale_of(self, columns: Tensor) -> Tensor:
        """Return log b [N, 1, H, W] of `columns`; b in pixels, kept within 0.01 and 100."""
        weighted = columns * self.weights[1:].view(1, -1, 1, 1)
        return (weighted.sum(dim=1, keepdim=True) + self.weights[0]).clamp(-LARGEST_LOG, LARGEST_LOG)

    def log_scale(self, evidence: Tensor, clues: Tensor | None) -> Tensor:
        """Return log b [N, 1, H, W] of the evidence and the clues."""
        return self.scale_of(self.columns(evidence, clues))

    def enlarged(self, log_scale: Tensor, factor: int) -> Tensor:
        """Return the confidence on a grid that is ``factor`` times as fine as that of log b [N, 1, H, W]."""
        trust: Tensor = self(enlarged(log_scale, factor))
        return trust

    def forward(self, log_scale: Tensor) -> Tensor:
        """Return P(|error| <= 1 px) of log b; same shape."""
        return confidence_of(log_scale)


class Surveyor(nn.Module):
    """A few thin convolutions over all evidence: what a single cell cannot tell, the cells around it can."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        # Evidence comes in many units. The statistics are those of the pairs that it learns from.
        self.register_buffer("mean", torch.zeros(1, channels, 1, 1))
        self.register_buffer("spread", torch.ones(1, channels, 1, 1))
        self.mix = nn.Conv2d(channels, HIDDEN, 1)
        self.layers = nn.ModuleList(nn.Conv2d(HIDDEN, HIDDEN, 3, padding=d, dilation=d) for d in DISTANCES)
        self.last = nn.Conv2d(HIDDEN, 1, 1)
        # Until it has learned it adds nothing.
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)  # type: ignore[arg-type]

    def forward(self, evidence: Tensor) -> Tensor:
        """Map evidence [N, C, h, w] to what is to be added to log b, [N, 1, h, w]."""
        out = F.relu(self.mix((evidence - self.get_buffer("mean")) / self.get_buffer("spread")))
        for layer in self.layers:
            out = F.relu(layer(out))
        result: Tensor = self.last(out)
        return result


def confidence_of(log_scale: Tensor) -> Tensor:
    """Return P(|error| <= 1 px) of log b; same shape."""
    return 1.0 - torch.exp(-torch.exp(-log_scale))


def log_scale_of(trust: Tensor) -> Tensor:
    """Return log b of the probability that `ConfidenceHead` gives for it; same shape."""
    return -torch.log(-torch.log1p(-trust))
