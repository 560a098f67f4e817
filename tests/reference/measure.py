"""The numpy twins of what is measured in a result: lengths and areas with their standard errors."""

from __future__ import annotations

import numpy as np

from endosdk import DepthResult

Array = np.ndarray


def sights(result: DepthResult, pixels: Array) -> Array:
    """Lines of sight [n,3] of pixels [n,2], with z = 1."""
    g = result.geometry
    x, y = (pixels[:, 0] - g.cx) / g.focal_px, (pixels[:, 1] - g.cy) / g.focal_y_px
    return np.column_stack([x, y, np.ones(len(pixels))])


def standard_errors(result: DepthResult, rows: Array, columns: Array) -> Array:
    """Those of depths: the standard deviation of a Laplace law, of which sigma is the scale."""
    return np.sqrt(2) * result.sigma[rows, columns].astype(float)


def correlation(result: DepthResult, pixels: Array, share: float) -> Array:
    """How the errors of depth at these pixels are correlated [n,n]; ``share`` of the width is the length of it."""
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    return np.exp(-apart / (share * result.depth.shape[1]))


def path_length(result: DepthResult, pixels: Array) -> tuple[float, float]:
    """Length of the line through the points, and its standard error to the second order."""
    pixels = np.asarray(pixels, float)
    columns, rows = np.rint(pixels).astype(int).T
    rays = sights(result, pixels)
    errors = standard_errors(result, rows, columns)
    covariance = 0.45 * np.outer(errors, errors) * correlation(result, pixels, 0.021)
    steps = np.diff(rays * result.depth[rows, columns].astype(float)[:, None], axis=0)
    slope, variance = np.zeros(len(pixels)), 0.0
    for i, step in enumerate(steps):
        length = np.linalg.norm(step)
        if length == 0:
            variance += covariance[i, i] + covariance[i + 1, i + 1] - 2 * covariance[i, i + 1]
            continue
        direction = step / length
        slope[i] -= direction @ rays[i]
        slope[i + 1] += direction @ rays[i + 1]
        across = rays[i : i + 2] - np.outer(rays[i : i + 2] @ direction, direction)
        moved = np.array([[1, -1], [-1, 1]]) * (across @ across.T) / length @ covariance[i : i + 2, i : i + 2]
        variance += 0.5 * np.trace(moved @ moved)
    return np.linalg.norm(steps, axis=1).sum(), np.sqrt(variance + slope @ covariance @ slope)


def area(result: DepthResult, polygon: Array) -> tuple[float, float, float, float, float]:
    """Area of the outline on the fitted plane, relief, both with standard errors, and the share of known pixels."""
    corners = np.asarray(polygon, float)
    rows, columns = inside(corners, result.depth.shape)
    known = np.isfinite(result.depth[rows, columns])
    total, rows, columns = len(rows), rows[known], columns[known]
    depth, errors = result.depth[rows, columns].astype(float), standard_errors(result, rows, columns)
    pixels = np.column_stack([columns, rows]).astype(float)
    origin = pixels.mean(axis=0)
    count = min(len(pixels), 600)
    some = ((np.arange(count) + np.arange(count) * 0.6180339887498949 % 1) * len(pixels) / count).astype(int)
    weight = depth[some] ** 2 / errors[some]
    fitted = np.linalg.pinv(np.column_stack([np.ones(count), pixels[some] - origin]) * weight[:, None])
    plane = fitted @ (weight / depth[some])
    covariance = fitted @ correlation(result, pixels[some], 0.05) @ fitted.T

    def flat(terms: Array) -> float:
        points = sights(result, corners) / (terms[0] + (corners - origin) @ terms[1:])[:, None]
        return np.linalg.norm(np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)) / 2

    steps = np.diag(1e-6 * abs(plane[0]) * np.array([1, 1e-2, 1e-2]))
    slope = np.array([(flat(plane + step) - flat(plane)) / step.max() for step in steps])
    g = result.geometry
    normal = np.array([
        plane[1] * g.focal_px,
        plane[2] * g.focal_y_px,
        plane[0] + plane[1:] @ (np.array([g.cx, g.cy]) - origin),
    ])  # fmt: skip
    towards = sights(result, pixels) @ (normal / np.linalg.norm(normal))
    low, high = np.percentile((depth - 1 / (plane[0] + (pixels - origin) @ plane[1:])) * towards, (2.5, 97.5))
    spread = np.sqrt(slope @ covariance @ slope)
    return flat(plane), spread, high - low, 2.3 * np.median(errors * np.abs(towards)), len(rows) / total


def inside(corners: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Rows and columns of the pixels whose centre lies inside a polygon, by counting crossings to the left."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    odd = np.zeros(shape, bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[1] != b[1]:
            crosses = (a[1] <= y) != (b[1] <= y)
            odd ^= crosses & (a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]) <= x)
    return np.nonzero(odd)
