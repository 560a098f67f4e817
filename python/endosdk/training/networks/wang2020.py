"""The network of the paper, layer for layer.

X.-Z. Wang, Y. Nie, S.-P. Lu, J. Zhang: "Deep Convolutional Network for Stereo Depth Mapping in Binocular Endoscopy",
IEEE Access 8, 2020, doi 10.1109/ACCESS.2020.2987767.

Twenty-three convolutions: three that bring the views to 1/8, six residual and one plain for the features, five over
the difference volume, eight that refine the upsampled map with the left view. Where the paper is silent we chose: batch norm
after the downsampling convolutions (without it the features do not learn to match in useful time), slope 0.2 of the
rectifiers, pixels scaled to about -2..2, the disparity given to the refinement in cells of 8 px.
"""

from __future__ import annotations

import copy

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import Prediction, StereoNetwork, Window
from endosdk.training.networks.blocks import ConvNorm, fold_batch_norm
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.cost_volume import (
    Aggregation,
    PlaneAggregation,
    difference_volume,
    local_range,
    soft_argmin,
)

CELL = 8  # input pixels per cell of the coarse grid, and per disparity plane
CHANNELS = 32
SLOPE = 0.2
DILATIONS = (1, 2, 4, 8, 1, 1)


class Wang2020(StereoNetwork):
    """Difference volume at 1/8 of the size, 3-D aggregation, soft-argmin, edge refinement at full size."""

    name = "wang2020"
    input_multiple = CELL
    output_stride = 1

    def __init__(self, max_disparity: int = 72) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 8."""
        super().__init__()
        if max_disparity <= 0 or max_disparity % CELL:
            raise InvalidArgument("max_disparity", f"must be a positive multiple of {CELL}", max_disparity)
        self.max_disparity = max_disparity
        widths = (3, CHANNELS, CHANNELS, CHANNELS)
        self.down = nn.Sequential(
            *(ConvNorm(i, o, kernel=5, stride=2, slope=SLOPE) for i, o in zip(widths, widths[1:], strict=False))
        )
        self.features = nn.Sequential(
            *(ConvNorm(CHANNELS, CHANNELS, slope=SLOPE, residual=True) for _ in range(6)),
            nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1),
        )
        self.aggregation: nn.Module = Aggregation(CHANNELS, layers=4, slope=SLOPE)
        self.refinement = nn.Sequential(
            ConvNorm(4, CHANNELS, slope=SLOPE),
            *(ConvNorm(CHANNELS, CHANNELS, dilation=d, slope=SLOPE, residual=True) for d in DILATIONS),
            nn.Conv2d(CHANNELS, 1, 3, padding=1),
        )
        # The refinement starts as the identity, so that it cannot spoil a coarse map that is already good.
        nn.init.zeros_(self.refinement[-1].weight)
        nn.init.zeros_(self.refinement[-1].bias)
        self.confidence = ConfidenceHead(channels=3)

    def coarse(self, left: Tensor, right: Tensor) -> Prediction:
        """Match at 1/8 and upsample: one map [N, 1, H, W], px."""
        # One pass over both views: shared weights, and batch norm sees the same statistics for left and right.
        views = self.features(self.down(torch.cat([_scaled(left), _scaled(right)])))
        pairs = left.shape[0]
        volume = difference_volume(views[:pairs], views[pairs:], self.max_disparity // CELL)
        found = soft_argmin(self.aggregation(volume))
        pixels = found.disparity * CELL
        doubt = torch.cat([torch.log(found.excess + 1e-3), torch.log(local_range(pixels.detach()) + 0.1)], dim=1)
        return Prediction([_upsampled(pixels)], _upsampled(doubt))

    def refine(self, coarse: Prediction, left: Tensor, window: Window | None = None) -> Prediction:
        """Add what the left view tells about edges; the second map has the window's size."""
        disparity, evidence = coarse.disparities[-1], coarse.evidence
        if window is not None:
            disparity, evidence, left = (window.of(m) for m in (disparity, evidence, left))
        correction = self.refinement(torch.cat([disparity / CELL, _scaled(left)], dim=1))
        evidence = torch.cat([evidence, torch.log(correction.detach().abs() + 0.05)], dim=1)
        return Prediction([*coarse.disparities, torch.relu(disparity + correction)], evidence)

    def export_form(self) -> nn.Module:
        """Copy with batch norm folded and the 3-D convolutions written as 2-D ones over neighbouring planes."""
        form = copy.deepcopy(self).eval()
        fold_batch_norm(form)
        if not isinstance(form.aggregation, Aggregation):
            raise TypeError("this network already has its export form")
        form.aggregation = PlaneAggregation(form.aggregation)
        return form


def _scaled(image: Tensor) -> Tensor:
    return image * (1.0 / 64.0) - 2.0


def _upsampled(cells: Tensor) -> Tensor:
    return F.interpolate(cells, scale_factor=float(CELL), mode="bilinear", align_corners=False)
