"""A small network for processors without a graphics card.

It follows the operator timings of ONNX Runtime on CPUs rather than a count of multiplications: one patch convolution in
place of a deep stem, a difference volume of few planes and few channels at 1/8 of the size, and nothing that is larger
than 1/4 of it. The last factor of four is left to the C++ layer.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork, check_max_disparity
from endosdk.training.networks.blocks import ConvNorm, ResidualPair, scaled_colours
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.cost_volume import Aggregation, difference_volume, match_evidence, soft_argmin

CELL = 8  # input pixels per cell of the matching grid, and per disparity plane
STRIDE = 4  # input pixels per cell of the answer
STEM, FEATURES, MATCHED = 32, 48, 16  # channels at 1/4, at 1/8, in the volume; multiples of 16 fill the vector units
SLOPE = 0.1


class Fast(StereoNetwork):
    """Patch stem, thin difference volume at 1/8, refinement and answer at 1/4; 0.18 M parameters."""

    name = "fast"
    input_multiple = CELL
    output_stride = STRIDE

    def __init__(self, max_disparity: int = 72) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 8."""
        super().__init__()
        self.max_disparity = check_max_disparity(max_disparity, CELL)
        # Even kernels with even padding keep every cell centred on the pixels it stands for.
        self.stem = ConvNorm(3, STEM, kernel=8, stride=STRIDE, padding=(2, 2), slope=SLOPE)
        self.features = nn.Sequential(
            ConvNorm(STEM, FEATURES, kernel=4, stride=2, padding=(1, 1), slope=SLOPE),
            ResidualPair(FEATURES, SLOPE),
            ResidualPair(FEATURES, SLOPE),
            nn.Conv2d(FEATURES, MATCHED, 3, padding=1),
        )
        self.aggregation = Aggregation(MATCHED, layers=3, slope=SLOPE)
        last = nn.Conv2d(STEM, 1, 3, padding=1)
        self.refinement = nn.Sequential(
            ConvNorm(STEM + 1, STEM, slope=SLOPE),
            *(ConvNorm(STEM, STEM, dilation=d, slope=SLOPE, residual=True) for d in (1, 2, 1)),
            last,
        )
        # The refinement starts as the identity, so that it cannot spoil a coarse map that is already good.
        nn.init.zeros_(last.weight)
        nn.init.constant_(last.bias, 0.0)  # type: ignore[arg-type]
        self.confidence = ConfidenceHead(channels=3)

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Match at 1/8 and upsample to 1/4."""
        stems = self.stem(scaled_colours(torch.cat([left, right])))
        views = self.features(stems)
        pairs = left.shape[0]
        volume = difference_volume(views[:pairs], views[pairs:], self.max_disparity // CELL)
        found = soft_argmin(self.aggregation(volume))
        disparity = found.disparity * CELL
        return Coarse(_doubled(disparity), _doubled(match_evidence(found, CELL)), stems[:pairs])

    def refine(self, coarse: Coarse) -> Prediction:
        """Add what the left view tells about edges, and rectify."""
        correction = self.refinement(torch.cat([coarse.disparity / CELL, coarse.context], dim=1))
        evidence = torch.cat([coarse.evidence, torch.log(correction.detach().abs() + 0.05)], dim=1)
        return Prediction([coarse.disparity, torch.relu(coarse.disparity + correction)], evidence)


def _doubled(cells: Tensor) -> Tensor:
    return F.interpolate(cells, scale_factor=2.0, mode="bilinear", align_corners=False)
