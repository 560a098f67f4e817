"""Points and lengths with their standard errors.

The standard error of a depth is the standard deviation of a Laplace law whose scale is `DepthResult.sigma`, 1.41 times
that: its interval of 95 % holds. In a length the mean square of errors counts, 0.45 of that of standard errors. Errors
of two pixels are correlated: the network looks at windows, so what misleads it at one pixel misleads it nearby. The
correlation taken here is ``exp(-r / L)`` at r pixels of the map, L 2.1 % of its width. Errors of the calibration are in
neither: they scale or bend all lengths together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.errors import CalibrationRequired, InvalidArgument
from endosdk.runtime.arguments import check_number, check_numbers
from endosdk.runtime.maps import ByteMap, FloatMap
from endosdk.runtime.result import DepthResult

Vector = npt.NDArray[np.float64]
Pixel = tuple[float, float]

NORMAL_95 = 1.96


@dataclass(frozen=True)
class Measured:
    """A value and its standard error, in ``unit``."""

    value: float
    standard_error: float
    unit: str = "mm"

    @property
    def interval(self) -> tuple[float, float]:
        """Where the true value lies with a probability of 95 %, for errors that are normally distributed."""
        reach = NORMAL_95 * self.standard_error
        return max(0.0, self.value - reach), self.value + reach

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.2f} {self.unit}, 95 % within {low:.2f} .. {high:.2f}"


@dataclass(frozen=True, eq=False)
class Point:
    """A point of the surface in the rectified left camera's frame (x right, y down, z forward), mm.

    ``covariance`` [3,3], mm²: it is long along the line of sight, because depth is what is uncertain.
    """

    xyz: Vector
    covariance: Vector

    @property
    def depth(self) -> Measured:
        """Distance along the optical axis."""
        return Measured(float(self.xyz[2]), float(np.sqrt(self.covariance[2, 2])))


def point_at(result: DepthResult, x: float, y: float) -> Point:
    """Return the point that pixel (x, y) shows; the pixel whose centre is nearest counts.

    Raises InvalidArgument where the pixel is outside the map or has no depth, CalibrationRequired without a rig.
    """
    at = [check_number(name, value, "must be a number, px") for name, value in (("x", x), ("y", y))]
    xyz, covariance = _core.point_at(*measured_maps(result), *at)
    return Point(xyz[0], covariance)


def distance(result: DepthResult, p: Pixel, q: Pixel) -> Measured:
    """Return the straight distance between the points at pixels ``p`` and ``q``, mm. Raises as `point_at` does."""
    return path_length(result, [p, q])


def path_length(result: DepthResult, pixels: Sequence[Pixel]) -> Measured:
    """Return the length of the line through the points at 2 to 10,000 pixels, mm. Raises as `point_at` does."""
    return Measured(*_core.path_length(*measured_maps(result), checked_pixels("pixels", pixels)))


def measured_maps(result: DepthResult) -> tuple[FloatMap, FloatMap, ByteMap, tuple[float, float, float, float]]:
    """Return what the core measures in: depth, sigma, reasons and the camera."""
    geometry = needed_geometry(result)
    camera = geometry.focal_px, geometry.focal_y_px, geometry.cx, geometry.cy
    return result.depth, result.sigma, result.reasons, camera


def checked_pixels(name: str, pixels: npt.ArrayLike) -> Vector:
    """Return pixels as float64 [n,2]. Raises InvalidArgument for anything else."""
    rule = "must be a list of (x, y)"
    array = check_numbers(name, pixels, rule)
    if array.ndim != 2 or array.shape[1] != 2:
        raise InvalidArgument(name, rule, f"shape {array.shape}")
    return np.ascontiguousarray(array)


def check_result(result: object) -> None:
    """Raise InvalidArgument for what is no result."""
    if not isinstance(result, DepthResult):
        raise InvalidArgument("result", "must be a DepthResult", type(result).__name__)


def needed_geometry(result: DepthResult) -> RectifiedGeometry:
    """Return the result's geometry. Raises CalibrationRequired where it has none, InvalidArgument for no result."""
    check_result(result)
    if result.geometry is None:
        rule = "measuring needs a calibration: pass DepthEstimator(..., calibration=rig)"
        raise CalibrationRequired("result", rule, "no calibration")
    return result.geometry
