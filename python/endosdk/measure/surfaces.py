"""The area inside a polygon and how far the surface stands out of its plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import RectifiedGeometry
from endosdk.errors import InvalidArgument
from endosdk.measure.correlation import correlation_length
from endosdk.measure.lengths import Measured, Pixel, correlation, needed_geometry, sight
from endosdk.runtime.result import DepthResult

Vector = npt.NDArray[np.float64]

LEAST_PIXELS = 30  # with depth, for a plane
MOST_PIXELS = 600  # that a plane is fitted to
# Standard error of the relief over that of a pixel: the extremes of many pixels stray further than one does. With it,
# 95 % intervals cover about that share of the reliefs of rendered training scenes.
RELIEF_FACTOR = 2.3
RELIEF_PERCENTILES = (2.5, 97.5)  # of the heights: single wrong pixels are no relief


@dataclass(frozen=True)
class Area:
    """What a polygon encloses.

    ``flat`` is the area of its outline on the plane that fits the surface inside best, mm²: what a ruler on a print of
    it would give. ``relief`` is how far the surface reaches from its lowest to its highest place across that plane, mm,
    without the outermost 5 % of the pixels. ``coverage`` is the share of the pixels inside that have a depth.
    """

    flat: Measured
    relief: Measured
    coverage: float


def area(result: DepthResult, polygon: Sequence[Pixel]) -> Area:
    """Measure the surface inside a polygon of three pixels or more.

    Raises InvalidArgument where the polygon leaves the map or holds too few pixels with depth, CalibrationRequired
    without a rig.
    """
    geometry = needed_geometry(result)
    corners = np.asarray(polygon, np.float64)
    rows, columns = _inside(corners, result.disparity.shape)
    known = np.isfinite(result.depth[rows, columns])
    total, rows, columns = len(rows), rows[known], columns[known]
    if len(rows) < LEAST_PIXELS:
        raise InvalidArgument("polygon", f"must hold {LEAST_PIXELS} pixels with depth or more", len(rows))
    depth = result.depth[rows, columns].astype(np.float64)
    sigma = result.sigma[rows, columns].astype(np.float64)
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    plane, covariance = _fit(pixels - pixels.mean(axis=0), depth, sigma, correlation_length(result))
    origin = pixels.mean(axis=0)
    value = _flat_area(geometry, corners, plane, origin)
    slope = np.array([
        (_flat_area(geometry, corners, plane + step, origin) - value) / step[i]
        for i, step in enumerate(np.diag(1e-6 * np.abs(plane[0]) * np.array([1.0, 1e-2, 1e-2])))
    ])  # fmt: skip
    flat = Measured(value, float(np.sqrt(slope @ covariance @ slope)), "mm²")
    return Area(flat, _relief(geometry, pixels, depth, sigma, plane, origin), len(rows) / total)


def _inside(corners: Vector, shape: tuple[int, ...]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return rows and columns of the pixels inside a polygon."""
    import cv2

    height, width = shape[:2]
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise InvalidArgument("polygon", "must be three pixels (x, y) or more", corners.shape)
    if corners.min() < -0.5 or (corners.max(axis=0) > (width - 0.5, height - 0.5)).any():
        raise InvalidArgument("polygon", f"must lie in the map of {width}x{height}", corners.tolist())
    mask = np.zeros((height, width), np.uint8)
    cv2.fillPoly(mask, [np.rint(corners).astype(np.int32)], 1)
    rows, columns = np.nonzero(mask)
    return rows, columns


def _fit(pixels: Vector, depth: Vector, sigma: Vector, correlation_px: float) -> tuple[Vector, Vector]:
    """Fit ``1 / depth = plane . (1, x, y)``, which is a plane in space; return it and its covariance.

    Neighbouring pixels hardly know more than one of them, so that some of them, spread evenly, serve for all.
    """
    some = np.linspace(0, len(pixels) - 1, min(len(pixels), MOST_PIXELS)).astype(int)
    pixels, depth, sigma = pixels[some], depth[some], sigma[some]
    weight = depth**2 / sigma  # 1 over the standard error of 1 / depth
    scaled = np.column_stack([np.ones(len(pixels)), pixels]) * weight[:, None]
    inverse = np.linalg.pinv(scaled)
    return np.asarray(inverse @ (weight / depth)), np.asarray(inverse @ correlation(pixels, correlation_px) @ inverse.T)


def _flat_area(geometry: RectifiedGeometry, corners: Vector, plane: Vector, origin: Vector) -> float:
    """Return the area of the polygon where its lines of sight meet the plane."""
    depths = 1.0 / (plane[0] + (corners - origin) @ plane[1:])
    points = np.array([sight(geometry, *corner) * depth for corner, depth in zip(corners, depths, strict=True)])
    return float(np.linalg.norm(np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)) / 2)


def _relief(
    geometry: RectifiedGeometry, pixels: Vector, depth: Vector, sigma: Vector, plane: Vector, origin: Vector
) -> Measured:
    normal = _normal(geometry, plane, origin)
    rays = np.column_stack([
        (pixels[:, 0] - geometry.cx) / geometry.focal_px,
        (pixels[:, 1] - geometry.cy) / geometry.focal_y_px,
        np.ones(len(pixels)),
    ])  # fmt: skip
    towards = rays @ normal
    flat = 1.0 / (plane[0] + (pixels - origin) @ plane[1:])
    low, high = np.percentile((depth - flat) * towards, RELIEF_PERCENTILES)
    return Measured(float(high - low), float(RELIEF_FACTOR * np.median(sigma * np.abs(towards))))


def _normal(geometry: RectifiedGeometry, plane: Vector, origin: Vector) -> Vector:
    """Return the unit normal of ``1 / z = plane . (1, x, y)`` with x, y in pixels from ``origin``."""
    a = plane[1] * geometry.focal_px
    b = plane[2] * geometry.focal_y_px
    c = plane[0] + plane[1] * (geometry.cx - origin[0]) + plane[2] * (geometry.cy - origin[1])
    normal = np.array([a, b, c])
    return np.asarray(normal / np.linalg.norm(normal))
