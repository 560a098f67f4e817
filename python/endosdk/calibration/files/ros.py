"""A pair of ROS camera_info files, left and right; ROS is in metres.

ROS stores no extrinsics. They follow from the rectification that both files carry: with the rectifying rotations
R_l, R_r and the right projection's fourth column, ``rotation = R_r' R_l`` and
``translation = R_r' (P_r[0,3] / P_r[0,0], 0, 0)``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from endosdk.calibration.files.stated import (
    MM_PER_UNIT,
    RawCalibration,
    lens_model,
    matrix,
    picture_size,
    required,
    yaml_mapping,
)
from endosdk.calibration.rules import CameraModel
from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.rectified_geometry import RectifiedGeometry
    from endosdk.calibration.rig import StereoCalibration

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Camera:
    path: Path
    size: tuple[int, int]
    model: CameraModel
    matrix: Matrix
    distortion: Matrix
    rectification: Matrix
    projection: Matrix


class CameraInfo(NamedTuple):
    """What ROS states of one view, lengths in metres: D, K, R and P."""

    distortion_model: str
    distortion: Matrix
    matrix: Matrix
    rectification: Matrix
    projection: Matrix


def camera_info(rig: StereoCalibration, geometry: RectifiedGeometry, side: str) -> CameraInfo:
    """Return what ROS states of the ``left`` or ``right`` view of a rig that is rectified to ``geometry``."""
    left = side == "left"
    model, distortion = _distortion_of(rig.model, rig.left_distortion if left else rig.right_distortion)
    projection = (geometry.P1 if left else geometry.P2).copy()
    projection[:, 3] /= MM_PER_UNIT["m"]
    rotation = geometry.R1 if left else geometry.R2
    return CameraInfo(model, distortion, rig.left_matrix if left else rig.right_matrix, rotation, projection)


def _distortion_of(model: CameraModel, coefficients: Matrix) -> tuple[str, Matrix]:
    """Return the distortion model that camera_info names, and as many coefficients as ROS wants of it."""
    if model == "fisheye":
        name, count = "equidistant", 4
    elif coefficients.size <= 5:
        name, count = "plumb_bob", 5
    else:
        name, count = "rational_polynomial", 8
    return name, np.pad(coefficients, (0, count - coefficients.size))


def looks_like(keys: Iterable[str]) -> bool:
    """Whether the names are those of a camera_info file or message."""
    present = set(keys)
    return any(names <= present for names in ({"camera_matrix"}, {"projection_matrix"}, {"K", "P"}, {"k", "p"}))


def read(paths: tuple[Path, ...]) -> RawCalibration:
    """Read (left, right)."""
    if len(paths) != 2:
        raise InvalidArgument("path", "ROS camera_info needs a pair: (left file, right file)", str(paths[0]))
    left, right = (_camera(path) for path in paths)
    if left.size != right.size:
        raise CalibrationSizeMismatch(right.path.name, f"must be for {left.size} like {left.path.name}", right.size)
    if left.model != right.model:
        raise CalibrationUnreadable(right.path.name, f"must be {left.model} like {left.path.name}", right.model)
    return RawCalibration(
        left_matrix=left.matrix,
        right_matrix=right.matrix,
        left_distortion=left.distortion,
        right_distortion=right.distortion,
        rotation=right.rectification.T @ left.rectification,
        translation=right.rectification.T @ _rectified_translation(left, right),
        size=left.size,
        unit="m",
        model=left.model,
    )


def _rectified_translation(left: _Camera, right: _Camera) -> Matrix:
    if left.projection[0, 3] != 0:
        rule = "must have 0 as the fourth number of its projection: the left file comes first"
        raise CalibrationUnreadable(left.path.name, rule, float(left.projection[0, 3]))
    if right.projection[0, 3] == 0 or right.projection[0, 0] == 0:
        rule = "must carry the baseline in its projection: these cameras were not calibrated as a stereo pair"
        raise CalibrationUnreadable(right.path.name, rule, right.projection[0].tolist())
    return np.array([right.projection[0, 3] / right.projection[0, 0], 0.0, 0.0])


def _camera(path: Path) -> _Camera:
    content = yaml_mapping(path)
    width = required(path, content, "image_width", "width")
    height = required(path, content, "image_height", "height")
    return _Camera(
        path,
        picture_size(path, width, height),
        lens_model(path, required(path, content, "distortion_model")),
        _numbers(path, content, (3, 3), "camera_matrix", "K", "k"),
        _numbers(path, content, (-1,), "distortion_coefficients", "D", "d"),
        _numbers(path, content, (3, 3), "rectification_matrix", "R", "r"),
        _numbers(path, content, (3, 4), "projection_matrix", "P", "p"),
    )


def _numbers(path: Path, content: Mapping[str, Any], shape: tuple[int, ...], *names: str) -> Matrix:
    """Return a matrix from ``{rows, cols, data}`` (files) or from the bare list (messages)."""
    value = required(path, content, *names)
    if isinstance(value, dict):
        value = required(path, value, "data")
    return matrix(path, names[0], value, shape)
