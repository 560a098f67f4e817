"""The confidence in the form in which it is deployed: a few functions of the model file, which take their weights."""

from __future__ import annotations

import copy

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.blocks import enlarged
from endosdk.training.networks.comparison import FINE
from endosdk.training.networks.confidence import DISTANCES, LARGEST_LOG, ConfidenceHead, confidence_of
from endosdk.training.networks.functions import as_function


class DeployedConfidence(nn.Module):
    """A `ConfidenceHead` whose computations are functions of the model file; only for grids of twice the size."""

    def __init__(self, head: ConfidenceHead) -> None:
        super().__init__()
        surveyor = head.surveyor
        assert surveyor is not None
        mean, spread = (surveyor.get_buffer(name).detach() for name in ("mean", "spread"))
        first = copy.deepcopy(surveyor.mix)
        with torch.no_grad():
            # The evidence is brought to mean 0 and spread 1 by the first layer.
            first.weight /= spread
            first.bias.sub_((first.weight * mean).sum(dim=(1, 2, 3)))  # type: ignore[union-attr]
            constant, of_evidence, of_survey = head.weights.tensor_split([1, -1])
            last = surveyor.last
            of_layers = of_survey * last.weight.flatten()
            total = torch.cat([constant + of_survey * last.bias, of_evidence, of_layers])  # type: ignore[operator]
        self.layers = nn.ModuleList([first, *surveyor.layers])
        self.register_buffer("total", total)
        self.scale = as_function(ScaleOfErrors())
        self.confidence = as_function(ConfidenceOfScale())

    def log_scale(self, evidence: Tensor, clues: Tensor) -> Tensor:
        """Do what `ConfidenceHead.log_scale` does."""
        weights = (value for layer in self.layers for value in (layer.weight, layer.bias))
        return self.scale(evidence, clues, *weights, self.get_buffer("total"))[0]  # type: ignore[no-any-return]

    def enlarged(self, log_scale: Tensor, factor: int) -> Tensor:
        """Do what `ConfidenceHead.enlarged` does."""
        assert factor == FINE
        return self.confidence(log_scale)[0]  # type: ignore[no-any-return]


class ScaleOfErrors(nn.Module):
    """The weighted sum of evidence and of four thin layers over evidence and clues, which come with their weights."""

    def forward(self, evidence: Tensor, clues: Tensor, weight: Tensor, bias: Tensor, *others: Tensor) -> tuple[Tensor]:
        """Map evidence and clues [N, C, h, w] to log b [N, 1, h, w].

        The weights are those of a layer over cells, then, in ``others``, those of one layer for each of `DISTANCES`,
        and those of the sum: its constant, of the evidence, of the outputs of the last layer.
        """
        *layers, total = others
        out = F.relu(F.conv2d(torch.cat([evidence, clues], dim=1), weight, bias))
        for distance, weight, bias in zip(DISTANCES, layers[::2], layers[1::2], strict=True):
            out = F.relu(F.conv2d(out, weight, bias, padding=distance, dilation=distance))
        columns = torch.cat([evidence, out], dim=1) * total[1:].view(1, -1, 1, 1)
        return ((columns.sum(dim=1, keepdim=True) + total[0]).clamp(-LARGEST_LOG, LARGEST_LOG),)


class ConfidenceOfScale(nn.Module):
    """The confidence on a grid of twice the size of that of log b."""

    def forward(self, log_scale: Tensor) -> tuple[Tensor]:
        """Map log b [N, 1, h, w] to the confidence [N, 1, 2h, 2w]."""
        return (confidence_of(enlarged(log_scale, FINE)),)
