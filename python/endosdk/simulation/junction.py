"""Where tubes meet, each loses the stretch of wall that lies inside another, so that the lumens join."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from endosdk.simulation.curve import even_points
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.noise import Array
from endosdk.simulation.shapes import Shape, Tube

AXIS_POINTS = 160


def join_lumens(shapes: Sequence[Shape], meshes: Sequence[Mesh]) -> list[Mesh]:
    """Return the meshes with the triangles removed that lie inside another lumen; other shapes are left alone."""
    lumens = [k for k, shape in enumerate(shapes) if isinstance(shape, Tube) and shape.inside]
    joined = list(meshes)
    for k in lumens:
        inside = np.zeros(len(meshes[k].positions), bool)
        for other in lumens:
            if other != k:
                inside |= _inside(meshes[k].positions, shapes[other], meshes[other])
        triangles = meshes[k].triangles
        joined[k] = replace(meshes[k], triangles=np.ascontiguousarray(triangles[~inside[triangles].all(1)]))
    return joined


def _inside(points: Array, shape: Shape, wall: Mesh) -> np.ndarray:
    """Return which points [N] lie inside the lumen: nearer to its axis than its wall is in that place."""
    assert isinstance(shape, Tube)
    axis = even_points(np.asarray(shape.control), AXIS_POINTS)[0].astype(np.float32)
    # How wide the lumen is around each point of its axis: the mean over the wall that is nearest to that point.
    nearest, distance = _nearest(wall.positions[::29], axis)
    count = np.maximum(np.bincount(nearest, minlength=AXIS_POINTS), 1)
    width = np.bincount(nearest, weights=distance, minlength=AXIS_POINTS) / count
    nearest, distance = _nearest(points, axis)
    return np.asarray(distance < 0.97 * width[nearest])


def _nearest(points: Array, axis: Array) -> tuple[np.ndarray, Array]:
    """Index of and distance to the nearest axis point, for points [N,3]."""
    index = np.empty(len(points), np.int64)
    square = np.empty(len(points), np.float32)
    axis_square = (axis**2).sum(1)
    for start in range(0, len(points), 20000):
        part = points[start : start + 20000]
        gaps = axis_square[None] - 2.0 * part @ axis.T
        index[start : start + 20000] = gaps.argmin(1)
        square[start : start + 20000] = gaps.min(1) + (part**2).sum(1)
    return index, np.sqrt(np.maximum(square, 0.0))
