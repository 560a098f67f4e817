"""The network of the paper, layer for layer.

X.-Z. Wang, Y. Nie, S.-P. Lu, J. Zhang: "Deep Convolutional Network for Stereo Depth Mapping in Binocular Endoscopy",
IEEE Access 8, 2020, doi 10.1109/ACCESS.2020.2987767.

Twenty-three convolutions: three that bring the views to 1/8, six residual and one plain for the features, five over
the difference volume, eight that refine the upsampled map with the left view. Where the paper is silent we chose:

- batch norm after the downsampling convolutions (without it the features do not learn to match in useful time) and
  rectifiers of slope 0.2;
- pixels scaled to -2..2, and the disparity given to the refinement in cells of 8 px;
- the third downsampling convolution is padded by one cell less above and left. A cell then lies where the bilinear
  upsampling puts it, within half a pixel; with even padding the coarse map would lie 3.5 px off the picture.

The same network can be asked for a step more, which has no weights: between matching and refinement the pictures
themselves correct the coarse map by a fraction of a pixel (`photometric.likely_step`).
"""

from __future__ import annotations

from functools import partial

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork, check_max_disparity
from endosdk.training.networks.blocks import ConvNorm, scaled_colours
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.cost_volume import Aggregation, match_evidence, soft_argmin
from endosdk.training.networks.photometric import brightness, likely_step, moments
from endosdk.training.networks.wang2020_export import PlaneAggregation, in_blocks

CELL = 8  # input pixels per cell of the coarse grid, and per disparity plane
CHANNELS = 32
SLOPE = 0.2
DILATIONS = (1, 2, 4, 8, 1, 1)


class Wang2020(StereoNetwork):
    """Difference volume at 1/8 of the size, 3-D aggregation, soft-argmin, edge refinement at full size."""

    name = "wang2020"
    input_multiple = CELL
    coarse_stride = output_stride = 1
    plane_step = CELL
    refine_margin = -(-(1 + sum(DILATIONS) + 1) // CELL) * CELL

    def __init__(self, max_disparity: int = 72, photometric: bool = False) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 8.

        With ``photometric`` the pictures correct the coarse map; the weights are the same.
        """
        super().__init__()
        self.photometric = photometric
        self.max_disparity = check_max_disparity(max_disparity, CELL)
        self.down = nn.Sequential(
            ConvNorm(3, CHANNELS, kernel=5, stride=2, slope=SLOPE),
            ConvNorm(CHANNELS, CHANNELS, kernel=5, stride=2, slope=SLOPE),
            ConvNorm(CHANNELS, CHANNELS, kernel=5, stride=2, padding=(1, 2), slope=SLOPE),
        )
        self.features = nn.Sequential(
            *(ConvNorm(CHANNELS, CHANNELS, slope=SLOPE, residual=True) for _ in range(6)),
            nn.Conv2d(CHANNELS, CHANNELS, 3, padding=1),
        )
        self.aggregation = Aggregation(CHANNELS, self.max_disparity // CELL, layers=4, slope=SLOPE)
        last = nn.Conv2d(CHANNELS, 1, 3, padding=1)
        self.refinement = nn.Sequential(
            ConvNorm(4, CHANNELS, slope=SLOPE),
            *(ConvNorm(CHANNELS, CHANNELS, dilation=d, slope=SLOPE, residual=True) for d in DILATIONS),
            last,
        )
        # The refinement starts as the identity, so that it cannot spoil a coarse map that is already good.
        nn.init.zeros_(last.weight)
        nn.init.constant_(last.bias, 0.0)  # type: ignore[arg-type]
        self.confidence = ConfidenceHead(channels=3)

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Match at 1/8, let the pictures correct the answer if asked to, and upsample to the input's size."""
        colours = scaled_colours(torch.cat([left, right]))
        # One pass over both views: shared weights, and batch norm sees the same statistics for left and right.
        views = self.features(self.down(colours))
        pairs = left.shape[0]
        found = soft_argmin(self.aggregation(views[:pairs], views[pairs:]))
        disparity = found.disparity * CELL
        if self.photometric:
            corrected = disparity + self.lacking(left, right, disparity.detach())
            disparity = corrected.clamp(0.0, float(self.max_disparity - CELL))
        # The size is given, not the factor: the exporter can follow it for every height and width.
        upsampled = partial(F.interpolate, size=left.shape[-2:], mode="bilinear", align_corners=False)
        return Coarse(upsampled(disparity), upsampled(match_evidence(found, CELL)), colours[:pairs])

    def lacking(self, left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
        """Return what the pictures say that a coarse disparity [N, 1, H/8, W/8], px, still lacks."""
        bright = brightness(torch.cat([left, right]))
        pairs = left.shape[0]
        return likely_step(moments(bright[:pairs], bright[pairs:], disparity, CELL))

    def refine(self, coarse: Coarse) -> Prediction:
        """Add what the left view tells about edges, and rectify."""
        correction = self.refinement(torch.cat([coarse.disparity / CELL, coarse.context], dim=1))
        evidence = torch.cat([coarse.evidence, torch.log(correction.detach().abs() + 0.05)], dim=1)
        return Prediction([coarse.disparity, torch.relu(coarse.disparity + correction)], evidence)

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode in the layouts of `wang2020_export`."""
        form = super().export_form()
        form.aggregation = PlaneAggregation(form.aggregation)  # type: ignore[arg-type]
        form.refinement[-1] = in_blocks(form.refinement[-1])  # type: ignore
        return form
