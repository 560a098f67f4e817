"""Points of a depth map as a PLY file, which viewers of point clouds read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument
from endosdk.io.names import file_name
from endosdk.io.whole_files import whole_file


def write_ply(path: str | Path, points: npt.NDArray[np.float32], colours: npt.NDArray[np.uint8] | None = None) -> int:
    """Write the points that are numbers, binary little-endian, and return how many there are.

    ``points`` is float32 [H, W, 3] as `DepthResult.points` gives them, mm; ``colours`` RGB uint8 [H, W, 3], such as the
    left view of `DepthEstimator.rectify`. Raises `InvalidArgument` where they do not match and `StorageFailed`.
    """
    path = file_name("path", path)
    for name, array in (("points", points), ("colours", points if colours is None else colours)):
        if not isinstance(array, np.ndarray):
            raise InvalidArgument(name, "must be a NumPy array", type(array).__name__)
    if points.ndim != 3 or points.shape[2] != 3:
        raise InvalidArgument("points", "must be [H, W, 3]", points.shape)
    if colours is not None and (colours.shape != points.shape or colours.dtype != np.uint8):
        raise InvalidArgument("colours", f"must be uint8 {points.shape}", (colours.dtype, colours.shape))
    known = np.isfinite(points).all(axis=2)
    fields = [(axis, "<f4") for axis in "xyz"]
    if colours is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue")]
    vertices = np.empty(np.count_nonzero(known), fields)
    for i, axis in enumerate("xyz"):
        vertices[axis] = points[..., i][known]
    if colours is not None:
        for i, name in enumerate(("red", "green", "blue")):
            vertices[name] = colours[..., i][known]
    kinds = {"<f4": "float", "u1": "uchar"}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment x right, y down, z forward from the rectified left camera, mm",
        f"element vertex {vertices.size}",
        *(f"property {kinds[kind]} {name}" for name, kind in fields),
        "end_header",
    ]
    with whole_file(path) as file:
        file.write(("\n".join(header) + "\n").encode("ascii"))
        file.write(vertices.tobytes())
    return int(vertices.size)
