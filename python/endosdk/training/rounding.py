"""Quantisation-aware training: layers compute with the 8-bit numbers of the deployed form.

Weights and activations are rounded on the way forward. The gradient passes as if they were not, but where an
activation was cut off at the end of its range (B. Jacob et al., "Quantization and training of neural networks for
efficient integer-arithmetic-only inference", CVPR 2018). The network keeps its weights and its file: only training
rounds.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.func import functional_call

from endosdk.training.integer_steps import LEAST_CHANNELS, LEVELS, convolution_steps
from endosdk.training.networks.blocks import ConvNorm, Numbers

AVERAGED = 0.02  # weight of a batch in the mean range of an activation
LEAST_STEP = 1e-8


def round_to_bytes(network: nn.Module) -> None:
    """Let every block of a network that is deployed in 8 bits round its weights and activations, in place.

    What is no block stays exact: the features that are matched, the costs, and the last layer of each stage. Batch norm
    scales the rows of the weights. Steps are those of rows, so that it changes no rounding.
    """
    for module in network.modules():
        if isinstance(module, ConvNorm) and module.conv.out_channels >= LEAST_CHANNELS:
            module.numbers = Bytes()


class Bytes(Numbers):
    """Numbers of 8 bits: weights signed with a step per output, activations unsigned with a mean range.

    Every batch moves the ranges, those of validation too: the first stage of a cascade never trains. They are no part
    of a checkpoint, so a resumed run measures them anew.
    """

    def __init__(self) -> None:
        self._ranges: dict[str, tuple[Tensor, Tensor]] = {}

    def convolved(self, conv: nn.Module, x: Tensor) -> Tensor:
        """Return ``conv`` of ``x`` with rounded weights."""
        assert isinstance(conv.weight, Tensor)
        out: Tensor = functional_call(conv, {"weight": rounded_weights(conv.weight)}, (x,))
        return out

    def value(self, name: str, x: Tensor) -> Tensor:
        """Return activations [N, ...] on 256 levels; ``name`` says which of the layer's."""
        x = x.float()
        with torch.no_grad():
            low, high = self._range(name, x.flatten(1))
            step = ((high - low) / LEVELS).clamp_min(LEAST_STEP)
            zero = torch.round(-low / step)
        inside = torch.minimum(torch.maximum(x, -zero * step), (LEVELS - zero) * step)
        return _straight_through(inside, torch.round(inside / step) * step)

    def _range(self, name: str, flat: Tensor) -> tuple[Tensor, Tensor]:
        """Return the mean smallest and largest value of a pair, 0 among them, this batch included."""
        seen = flat.amin(dim=1).clamp_max(0.0).mean(), flat.amax(dim=1).clamp_min(0.0).mean()
        before = self._ranges.get(name, seen)
        low, high = (old + AVERAGED * (new - old) for old, new in zip(before, seen, strict=True))
        self._ranges[name] = low, high
        return low, high


def rounded_weights(weights: Tensor) -> Tensor:
    """Round the weights of a convolution [outputs, inputs, ...] to the steps of its 8-bit form."""
    with torch.no_grad():
        steps = torch.from_numpy(convolution_steps(weights.float().cpu().numpy())).to(weights.device)
        steps = steps.view(-1, *(1,) * (weights.ndim - 1))
    return _straight_through(weights, torch.round(weights / steps) * steps)


def _straight_through(x: Tensor, rounded: Tensor) -> Tensor:
    """Return ``rounded`` with the gradient of ``x``."""
    return x + (rounded - x).detach()
