"""What one stereo pair gives: disparity, depth, confidence, expected error, and why a pixel has no answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from endosdk._core import Reason as Reason
from endosdk._core import Status as Status
from endosdk._core import calibration_rule
from endosdk.calibration.rig import RectifiedGeometry
from endosdk.errors import CalibrationRequired
from endosdk.runtime.maps import ByteMap, FloatMap
from endosdk.runtime.models import ModelInfo


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
    valid_share: float  # share of pixels with reasons == 0, the valid ones
    timings: Timings
    late: bool  # the frame took longer than the estimator's deadline, waiting included
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

    def to_open3d(self, left: ByteMap | None = None) -> Any:
        """Return `points` as an Open3D point cloud; see `endosdk.io.interop.to_open3d`."""
        from endosdk.io import interop

        return interop.to_open3d(self, left)

    def to_rerun(self, left: ByteMap | None = None, entity: str = "endosdk") -> None:
        """Log this result to Rerun; see `endosdk.io.interop.to_rerun`."""
        from endosdk.io import interop

        interop.to_rerun(self, left, entity)


def _no_calibration(name: str) -> CalibrationRequired:
    return CalibrationRequired(name, calibration_rule, "no calibration")
