"""What one stereo pair gives: disparity, depth, confidence, expected error, and why a pixel has no answer."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import RectifiedGeometry
from endosdk.errors import CalibrationRequired
from endosdk.runtime.models import ModelInfo

FloatMap = npt.NDArray[np.float32]
ByteMap = npt.NDArray[np.uint8]


class Reason(IntFlag):
    """Why a pixel has no depth: the bits of `DepthResult.reasons`."""

    LOW_CONFIDENCE = 1  # the network does not trust its own answer, or the two views do not agree on it
    OCCLUDED = 2  # a nearer surface covers the match in the right view
    OUTSIDE_OVERLAP = 4  # the right camera does not see this point, or the lens map has no source pixel
    OUT_OF_RANGE = 8  # no finite positive depth, one outside the range asked for, or one that the network cannot find
    SATURATED = 16  # all three colours of the left view are blown out: glare


class Status(IntEnum):
    """One word on the whole frame, from the share of pixels that have an answer."""

    OK = 0  # at least half of the pixels have an answer
    DEGRADED = 1  # less than half
    INVALID = 2  # less than a twentieth: do not use this frame


@dataclass(frozen=True)
class Timings:
    """Milliseconds spent in each stage of one frame."""

    rectify_ms: float
    session_ms: float
    postprocess_ms: float

    @property
    def total_ms(self) -> float:
        """Sum of the three stages, ms."""
        return self.rectify_ms + self.session_ms + self.postprocess_ms


@dataclass(frozen=True, eq=False)
class DepthResult:
    """Answer for one stereo pair, all maps [H, W] at the size of the rectified left view.

    ``disparity`` is dense, px of this map (``x_right = x_left - disparity``). ``confidence`` is the probability, 0..1,
    that the disparity is right to one pixel on the grid the network saw; it is 0 where the two views do not agree at
    that disparity, and everywhere when they do not show the same. ``reasons`` holds `Reason` bits, 0 where the pixel
    has an answer. Depth and sigma are NaN exactly where ``reasons`` is not 0.
    """

    disparity: FloatMap
    confidence: FloatMap
    reasons: ByteMap
    status: Status
    valid_share: float  # share of pixels with reasons == 0
    timings: Timings
    frame: int  # counts the frames of this estimator from 1
    model: ModelInfo
    geometry: RectifiedGeometry | None
    calibration_sha256: str | None
    depth_map: FloatMap | None
    sigma_map: FloatMap | None

    @property
    def depth(self) -> FloatMap:
        """Distance along the optical axis, mm, float32 [H, W]; NaN where `reasons` says why there is none."""
        if self.depth_map is None:
            raise _no_calibration("depth")
        return self.depth_map

    @property
    def sigma(self) -> FloatMap:
        """Expected standard error of `depth`, mm, float32 [H, W]: depth^2 / (f B) times that of the disparity."""
        if self.sigma_map is None:
            raise _no_calibration("sigma")
        return self.sigma_map

    def points(self) -> FloatMap:
        """Points in the rectified left camera's frame (x right, y down, z forward), mm, float32 [H, W, 3]."""
        depth = self.depth
        if self.geometry is None:
            raise _no_calibration("points")
        rows, columns = np.indices(depth.shape, dtype=np.float32)
        x = (columns - np.float32(self.geometry.cx)) * depth / np.float32(self.geometry.focal_px)
        y = (rows - np.float32(self.geometry.cy)) * depth / np.float32(self.geometry.focal_y_px)
        return np.stack([x, y, depth], axis=-1)


def status_of(valid_share: float) -> Status:
    """Judge a frame by the share of its pixels that have an answer."""
    if valid_share < 0.05:
        return Status.INVALID
    return Status.DEGRADED if valid_share < 0.5 else Status.OK


def _no_calibration(name: str) -> CalibrationRequired:
    return CalibrationRequired(
        name, "metric output needs a calibration: pass DepthEstimator(..., calibration=rig)", "no calibration"
    )
