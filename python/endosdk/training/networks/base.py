"""What every network offers to training, calibration and export."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import torch
from torch import Tensor, nn

from endosdk.training.networks.confidence import ConfidenceHead


class Window(NamedTuple):
    """Part of the input, in input pixels; every number is a multiple of the network's ``input_multiple``."""

    top: int
    left: int
    height: int
    width: int

    def of(self, image: Tensor, stride: int = 1) -> Tensor:
        """Cut this part out of a map [N, C, H/stride, W/stride]."""
        rows = slice(self.top // stride, (self.top + self.height) // stride)
        columns = slice(self.left // stride, (self.left + self.width) // stride)
        return image[..., rows, columns]


class Prediction(NamedTuple):
    """Disparity maps from coarse to fine, and what tells how far the finest can be trusted."""

    disparities: list[Tensor]  # each [N, 1, H/s, W/s], px at the input width; a windowed one has the window's size
    evidence: Tensor  # [N, K, H/s, W/s] of the last map, no gradient flows through it


class StereoNetwork(nn.Module, ABC):
    """A network from a rectified pair to disparity; sub-classes set the four attributes."""

    name: str
    max_disparity: int
    input_multiple: int
    output_stride: int
    confidence: ConfidenceHead

    @abstractmethod
    def coarse(self, left: Tensor, right: Tensor) -> Prediction:
        """Match the views [N, 3, H, W], 0..255: one map, on the grid on which `refine` works."""

    @abstractmethod
    def refine(self, coarse: Prediction, left: Tensor, window: Window | None) -> Prediction:
        """Sharpen the coarse map with the left view, inside the window or everywhere."""

    def forward(self, left: Tensor, right: Tensor, refined: bool = True, window: Window | None = None) -> Prediction:
        """Predict from float views [N, 3, H, W], 0..255; H and W are multiples of ``input_multiple``.

        Without ``refined`` only the coarse map is computed. A window limits the refinement, which is local and by far
        the dearest part of training.
        """
        coarse = self.coarse(left, right)
        return self.refine(coarse, left, window) if refined else coarse

    def export_form(self) -> nn.Module:
        """Return an equal network whose layers suit the deployed runtime; may be the network itself."""
        return self


class Deployed(nn.Module):
    """The whole function of a model file: uint8 views in, disparity and confidence out."""

    def __init__(self, network: StereoNetwork, confidence: ConfidenceHead) -> None:
        super().__init__()
        self.network = network
        self.confidence = confidence

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 [N, 3, H, W] to disparity and confidence, float32 [N, 1, H/s, W/s]."""
        prediction = self.network(left.to(torch.float32), right.to(torch.float32))
        return prediction.disparities[-1], self.confidence(prediction.evidence)
