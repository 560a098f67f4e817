"""Points and lengths with their standard errors.

The error of a depth is that of `DepthResult.sigma`. Errors of two pixels are correlated: the network looks at windows,
so what misleads it at one pixel misleads it nearby. The correlation taken here is ``exp(-r / L)`` at r pixels of the
map, L by `correlation_length`. Errors of the calibration are in neither: they scale or bend all lengths together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import RectifiedGeometry
from endosdk.errors import CalibrationRequired, InvalidArgument
from endosdk.measure.correlation import correlation_length
from endosdk.runtime.result import DepthResult, Reason

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
    ray, depth, sigma = _sighted(result, (x, y))
    return Point(ray * depth, np.outer(ray, ray) * sigma**2)


def distance(result: DepthResult, p: Pixel, q: Pixel) -> Measured:
    """Return the straight distance between the points at pixels ``p`` and ``q``, mm. Raises as `point_at` does."""
    return path_length(result, [p, q])


def path_length(result: DepthResult, pixels: Sequence[Pixel]) -> Measured:
    """Return the length of the line through the points at two pixels or more, mm. Raises as `point_at` does."""
    if len(pixels) < 2:
        raise InvalidArgument("pixels", "must be two or more", len(pixels))
    sighted = [_sighted(result, pixel) for pixel in pixels]
    rays = np.array([ray for ray, _, _ in sighted])
    depths = np.array([depth for _, depth, _ in sighted])
    sigmas = np.array([sigma for _, _, sigma in sighted])
    covariance = np.outer(sigmas, sigmas) * correlation(np.asarray(pixels, np.float64), correlation_length(result))
    points = rays * depths[:, None]
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    slope, variance = np.zeros(len(pixels)), 0.0
    for i, (step, length) in enumerate(zip(steps, lengths, strict=True)):
        direction = step / length if length > 0 else np.zeros(3)
        change = np.zeros(len(pixels))  # of this length, by mm of each depth
        change[i], change[i + 1] = -direction @ rays[i], direction @ rays[i + 1]
        slope += change
        variance += _curvature_term(rays[i : i + 2], direction, float(length), covariance[i : i + 2, i : i + 2])
    variance += float(slope @ covariance @ slope)
    return Measured(float(lengths.sum()), float(np.sqrt(variance)))


def correlation(pixels: Vector, length_px: float) -> Vector:
    """Return how the errors of depth at these pixels [n,2] are correlated, [n,n]."""
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    return np.asarray(np.exp(-apart / length_px))


def _curvature_term(rays: Vector, direction: Vector, length: float, covariance: Vector) -> float:
    """Return the part of a length's variance that its slope misses: errors across the line always lengthen it."""
    across = rays - np.outer(rays @ direction, direction)
    if length <= 0:
        return float(np.trace(covariance))
    hessian = np.array([[1.0, -1.0], [-1.0, 1.0]]) * (across @ across.T) / length
    moved = hessian @ covariance
    return 0.5 * float(np.trace(moved @ moved))


def _sighted(result: DepthResult, pixel: Pixel) -> tuple[Vector, float, float]:
    """Return the line of sight (z = 1), the depth and its standard error at a pixel."""
    geometry = needed_geometry(result)
    height, width = result.disparity.shape
    x, y = (float(each) for each in pixel)
    if not (-0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5):
        raise InvalidArgument("pixel", f"must lie in the map of {width}x{height}", (x, y))
    column, row = round(x), round(y)
    depth, sigma = float(result.depth[row, column]), float(result.sigma[row, column])
    if not np.isfinite(depth):
        why = Reason(int(result.reasons[row, column])).name or "unknown"
        raise InvalidArgument("pixel", f"must have a depth; this one has none: {why}", (x, y))
    return sight(geometry, x, y), depth, sigma


def sight(geometry: RectifiedGeometry, x: float, y: float) -> Vector:
    """Return the line of sight of a pixel in the rectified left camera's frame, with z = 1."""
    return np.array([(x - geometry.cx) / geometry.focal_px, (y - geometry.cy) / geometry.focal_y_px, 1.0])


def needed_geometry(result: DepthResult) -> RectifiedGeometry:
    """Return the result's geometry. Raises CalibrationRequired where it has none."""
    if result.geometry is None:
        rule = "measuring needs a calibration: pass DepthEstimator(..., calibration=rig)"
        raise CalibrationRequired("result", rule, "no calibration")
    return result.geometry
