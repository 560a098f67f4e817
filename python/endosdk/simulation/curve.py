"""Bézier curves and frames that move along them without twisting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def bezier(control: Floats, t: Floats) -> Floats:
    """Return points [N,3] of the Bézier curve with control points [K,3] at parameters [N] in 0..1."""
    degree = len(control) - 1
    k = np.arange(degree + 1)
    weights = np.array([math.comb(degree, i) for i in k]) * t[:, None] ** k * (1.0 - t[:, None]) ** (degree - k)
    return np.asarray(weights @ control)


def even_points(control: Floats, count: int) -> tuple[Floats, float]:
    """Return ``count`` points at equal arc length along the curve, and its length."""
    dense = bezier(control, np.linspace(0.0, 1.0, 2000))
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    wanted = np.linspace(0.0, travelled[-1], count)
    return np.stack([np.interp(wanted, travelled, dense[:, k]) for k in range(3)], 1), float(travelled[-1])


def moving_frames(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return tangents, normals and binormals [N,3] along points [N,3], carried forward with the least rotation."""
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    start = np.eye(3)[int(np.argmin(np.abs(tangents[0])))]
    normals = np.empty_like(points)
    current = start
    for i, tangent in enumerate(tangents):
        current = current - tangent * (current @ tangent)
        current = current / np.linalg.norm(current)
        normals[i] = current
    return tangents, normals, np.cross(tangents, normals)
