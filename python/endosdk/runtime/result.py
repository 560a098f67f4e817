"""What one stereo pair gives: disparity, depth, confidence, expected error, and why a pixel has no answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from endosdk._core import Cause as Cause
from endosdk._core import Identity as Identity
from endosdk._core import Reason as Reason
from endosdk._core import Status as Status
from endosdk._core import calibration_rule
from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.errors import CalibrationRequired
from endosdk.runtime.maps import ByteMap, FloatMap, Maps
from endosdk.runtime.models import ModelInfo
from endosdk.runtime.rig_error import RigError


def _by_name(self: Any) -> str:
    return str(self.name)


for _words in (Status, Cause):  # printed as words, and not as the numbers that they are to C
    _words.__str__ = _by_name  # type: ignore[method-assign]


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


@dataclass(frozen=True, eq=False, repr=False)
class DepthResult:
    """Answer for one stereo pair, all maps [H, W] at the size of the rectified left view.

    The maps are read by their names, as properties. Depth and sigma are NaN exactly where ``reasons`` is not 0.
    """

    maps: Maps
    status: Status  # follows from the causes, by the table in docs/trust.md
    causes: dict[Cause, float]  # what is wrong with the frame, with the measure of each; empty: nothing
    measures: dict[Cause, float]  # all that was measured of the frame, wrong or not
    valid_share: float  # share of pixels with reasons == 0, the valid ones
    rig: RigError | None  # what the pictures tell of the rig; None where too little could be measured
    timings: Timings
    late: bool  # the frame took longer than the estimator's deadline, waiting included
    frame: int  # counts the frames of this estimator from 1
    model: ModelInfo
    geometry: RectifiedGeometry | None
    calibration_sha256: str | None
    identity: Identity  # all that the result was computed with: versions, hashes, provider, processor
    stamp_ns: int | None = None  # when the pair was taken, as it was given
    age_ms: float | None = None  # age of the pair when this result was handed out; None without a stamp
    dropped: int = 0  # in a stream with `queue="newest"`: pairs of the source that were dropped before this one
    source_frame: Any = None  # in a stream of `open_source`: the `Frame`, with number, time stamp, tag and both views

    def __repr__(self) -> str:
        """One line for people: maps are not printed."""
        height, width = self.maps.disparity.shape
        causes = ", ".join(cause.name for cause in self.causes) or "no cause"
        known = "disparity alone, no calibration"
        if self.maps.depth is not None:
            seen = self.maps.depth[self.maps.reasons == 0]
            known = "no depth"
            if seen.size:
                known = f"depth {seen.min():.1f} .. {seen.max():.1f} mm (median {np.median(seen):.1f})"
        return (
            f"<DepthResult of frame {self.frame}: {width}x{height}, {self.status.name} ({causes}), "
            f"{100 * self.valid_share:.1f} % valid, {known}, {self.model.name} {self.model.version}, "
            f"{self.timings.total_ms:.1f} ms>"
        )

    @property
    def disparity(self) -> FloatMap:
        """Disparity, px of this map, float32 [H, W], dense: ``x_right = x_left - disparity``."""
        return self.maps.disparity

    @property
    def confidence(self) -> FloatMap:
        """Probability 0..1 that the disparity is right to 1/480 of the width (2 px at 960), float32 [H, W].

        It is 0 where the two views do not agree at that disparity, and everywhere when they do not show the same.
        """
        return self.maps.confidence

    @property
    def reasons(self) -> ByteMap:
        """Bits of `Reason`, uint8 [H, W]; 0 where the pixel is valid."""
        return self.maps.reasons

    @property
    def reason_shares(self) -> dict[str, float]:
        """Share (0..1) of all pixels for which each reason holds, by its name; a pixel can have several."""
        counts = np.bincount(self.reasons.ravel(), minlength=256)
        bits = np.arange(counts.size)
        return {str(r.name): float(counts[(bits & r.value) != 0].sum() / self.reasons.size) for r in Reason}

    @property
    def depth_map(self) -> FloatMap | None:
        """`depth`, or None without a calibration."""
        return self.maps.depth

    @property
    def sigma_map(self) -> FloatMap | None:
        """`sigma`, or None without a calibration."""
        return self.maps.sigma

    @property
    def depth(self) -> FloatMap:
        """Distance along the optical axis, mm, float32 [H, W]; NaN where `reasons` says why there is none."""
        if self.depth_map is None:
            raise _no_calibration("depth")
        return self.depth_map

    @property
    def sigma(self) -> FloatMap:
        """Expected absolute error of `depth`, mm, float32 [H, W]: depth^2 / (f B) times that of the disparity.

        It is the scale of a Laplace law: about two thirds of the errors are smaller. NaN where `depth` is.
        """
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
        """Return `points` as an Open3D point cloud; see `endosdk.runtime.interop.to_open3d`."""
        from endosdk.runtime import interop

        return interop.to_open3d(self, left)

    def to_rerun(self, left: ByteMap | None = None, entity: str = "endosdk") -> None:
        """Log this result to Rerun; see `endosdk.runtime.interop.to_rerun`."""
        from endosdk.runtime import interop

        interop.to_rerun(self, left, entity)


def _no_calibration(name: str) -> CalibrationRequired:
    return CalibrationRequired(name, calibration_rule, "no calibration")
