"""Kalibr's camchain of two pinhole cameras, cam0 left and cam1 right, with radtan or equi distortion; metres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.files.stated import RawCalibration, lens_model, matrix, picture_size, required, yaml_mapping
from endosdk.calibration.rules import CameraModel
from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, InvalidArgument

Matrix = npt.NDArray[np.float64]


def looks_like(keys: Iterable[str]) -> bool:
    """Whether the names are those of a camchain."""
    return "cam0" in set(keys)


def read(paths: tuple[Path, ...]) -> RawCalibration:
    """Read one camchain."""
    if len(paths) != 1 or paths[0].is_dir():
        raise InvalidArgument("path", "a Kalibr camchain is one file", [str(path) for path in paths])
    path = paths[0]
    content = yaml_mapping(path)
    cameras = [name for name in content if name.startswith("cam")]
    if sorted(cameras) != ["cam0", "cam1"]:
        raise CalibrationUnreadable(path.name, "must hold cam0 and cam1 and no other camera", cameras)
    left, right = (_mapping(path, content, name) for name in ("cam0", "cam1"))
    sizes = [picture_size(path, *_pair(path, camera)) for camera in (left, right)]
    if sizes[0] != sizes[1]:
        raise CalibrationSizeMismatch(f"{path.name}: cam1", f"must have the resolution of cam0, {sizes[0]}", sizes[1])
    models = [_model(path, camera) for camera in (left, right)]
    if models[0] != models[1]:
        raise CalibrationUnreadable(path.name, "must use one distortion model for both cameras", models)
    # T_cn_cnm1 takes a point of the camera before, cam0, into this one, cam1.
    transform = matrix(path, "T_cn_cnm1", required(path, right, "T_cn_cnm1"), (4, 4))
    return RawCalibration(
        left_matrix=_camera_matrix(path, left),
        right_matrix=_camera_matrix(path, right),
        left_distortion=_distortion(path, left),
        right_distortion=_distortion(path, right),
        rotation=transform[:3, :3],
        translation=transform[:3, 3],
        size=sizes[0],
        unit="m",
        model=models[0],
    )


def _mapping(path: Path, content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    camera = required(path, content, name)
    if not isinstance(camera, dict):
        raise CalibrationUnreadable(f"{path.name}: {name}", "must be a mapping", type(camera).__name__)
    return camera


def _pair(path: Path, camera: Mapping[str, Any]) -> tuple[float, float]:
    width, height = matrix(path, "resolution", required(path, camera, "resolution"), (2,))
    return float(width), float(height)


def _model(path: Path, camera: Mapping[str, Any]) -> CameraModel:
    projection = camera.get("camera_model", "pinhole")
    if projection != "pinhole":
        raise CalibrationUnreadable(f"{path.name}: camera_model", "must be pinhole", projection)
    return lens_model(path, required(path, camera, "distortion_model"))


def _distortion(path: Path, camera: Mapping[str, Any]) -> Matrix:
    return matrix(path, "distortion_coeffs", required(path, camera, "distortion_coeffs"), (-1,))


def _camera_matrix(path: Path, camera: Mapping[str, Any]) -> Matrix:
    fx, fy, cx, cy = matrix(path, "intrinsics", required(path, camera, "intrinsics"), (4,))
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
