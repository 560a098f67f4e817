"""How far a disparity can be trusted, as a calibrated probability."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class ConfidenceHead(nn.Module):
    """Turn evidence into the probability that the disparity is wrong by at most one pixel.

    The error is taken to follow a Laplace law whose scale b depends on the evidence: log b is linear in the logarithms
    of what the network knows about its own answer. The weights are no part of training; they are fitted afterwards on
    pairs that were held out (`endosdk.training.calibrate`).
    """

    weights: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        # Before calibration: b grows with the square root of the first channel, which holds a variance.
        start = torch.zeros(channels + 1)
        start[1] = 0.5
        self.register_buffer("weights", start)

    def log_scale(self, evidence: Tensor) -> Tensor:
        """Return log b [N, 1, H, W] of the evidence [N, K, H, W]; b in pixels, kept within 0.01 and 100."""
        weighted = evidence * self.weights[1:].view(1, -1, 1, 1)
        return (weighted.sum(dim=1, keepdim=True) + self.weights[0]).clamp(-4.6, 4.6)

    def forward(self, log_scale: Tensor) -> Tensor:
        """Return P(|error| <= 1 px) of `log_scale`; same shape."""
        return 1.0 - torch.exp(-torch.exp(-log_scale))


def log_scale_of(trust: Tensor) -> Tensor:
    """Return log b of the probability that `ConfidenceHead` gives for it; same shape."""
    return -torch.log(-torch.log1p(-trust))
