"""From the session's grids to maps at the size of the frame: disparity, confidence, depth, sigma, reasons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.calibration.rig import RectifiedGeometry
from endosdk.runtime.rectify import RectifyStage
from endosdk.runtime.session import Buffers

FloatMap = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Maps:
    """Output memory of one frame, all [H, W]; depth and sigma are None without a calibration."""

    disparity: FloatMap
    confidence: FloatMap
    reasons: npt.NDArray[np.uint8]
    depth: FloatMap | None
    sigma: FloatMap | None

    @classmethod
    def allocate(cls, width: int, height: int, metric: bool) -> Maps:
        """Reserve memory for maps of this size, px."""

        def floats() -> FloatMap:
            return np.empty((height, width), np.float32)

        reasons = np.empty((height, width), np.uint8)
        return cls(floats(), floats(), reasons, floats() if metric else None, floats() if metric else None)

    @property
    def writeable(self) -> bool:
        """Whether all maps can be written."""
        maps = (self.disparity, self.confidence, self.reasons, self.depth, self.sigma)
        return all(each.flags.writeable for each in maps if each is not None)


@dataclass(frozen=True)
class Limits:
    """What counts as an answer."""

    min_confidence: float  # below it a pixel is LOW_CONFIDENCE
    min_depth_mm: float  # outside [min, max] a pixel is OUT_OF_RANGE
    max_depth_mm: float
    max_candidate_disparity: int | None  # px of what the network sees; there a pixel is OUT_OF_RANGE


def postprocess(
    found: Buffers,
    stage: RectifyStage,
    geometry: RectifiedGeometry | None,
    limits: Limits,
    out: Maps,
    same_frames: bool,
) -> int:
    """Fill ``out`` from the buffers of a run and return the number of pixels that have an answer.

    With ``same_frames`` both cameras gave the same bytes: one of them is connected twice, and nothing is an answer.
    """
    height, width = out.disparity.shape
    # Relative to the picture without its padding, which the grids include.
    scale_y, scale_x = stage.size[1] / height, stage.size[0] / width
    stride = found.left.shape[2] // found.disparity.shape[1]
    return _core.postprocess(
        found.disparity,
        found.confidence,
        scale_y / stride,
        scale_x / stride,
        1.0 / scale_x,
        out.disparity,
        out.confidence,
        out.reasons,
        found.left,
        stage.valid_left,
        stage.valid_right,
        limits.min_confidence,
        out.depth,
        out.sigma,
        geometry.focal_px if geometry else 0.0,
        geometry.baseline_mm if geometry else 0.0,
        geometry.doffs if geometry else 0.0,
        limits.min_depth_mm,
        limits.max_depth_mm,
        scale_y,
        scale_x,
        limits.max_candidate_disparity or 0,
        found.right,
        same_frames,
        stage.right_shift,
    )
