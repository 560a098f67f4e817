"""Write a rig in the layouts of other programs; the file's name says which.

| name | layout |
|---|---|
| ``NAME.opencv.yaml`` | OpenCV's FileStorage: K1 D1 K2 D2 R T, distortion_model, R1 R2 P1 P2 (Q of square pixels); mm |
| ``NAME.ros.yaml`` | ``NAME.left.ros.yaml`` and ``NAME.right.ros.yaml``, a pair of camera_info; metres |
| ``NAME.kalibr.yaml`` | a camchain; metres |
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from endosdk.calibration.files import native
from endosdk.calibration.files.native import NumbersInLines
from endosdk.calibration.files.ros import camera_info
from endosdk.calibration.files.stated import MM_PER_UNIT
from endosdk.errors import InvalidArgument
from endosdk.io.names import file_name
from endosdk.io.whole_files import write_text

if TYPE_CHECKING:
    from endosdk.calibration.rig import StereoCalibration

ROS_ENDING = ".ros.yaml"

Writer = Callable[["StereoCalibration", Path], list[Path]]  # returns the files written; raises `StorageFailed`


def writer_of(path: Path) -> Writer | None:
    """Return what writes the layout of another program that a name asks for by its ending, or None."""
    return next((write for ending, write in WRITERS.items() if path.name.lower().endswith(ending)), None)


def write_export(write: Writer, calibration: StereoCalibration, path: Path) -> list[Path]:
    """Write a rig in another layout, which has no field of view: the log ``endosdk`` warns where one is stated."""
    lost = [side for side in ("left", "right") if getattr(calibration, f"{side}_field_of_view") is not None]
    written = write(calibration, path)
    if lost:
        logging.getLogger("endosdk").warning(
            "%s: this format cannot hold field_of_view (%s): it is left out; .json and .yaml keep it",
            path,
            " and ".join(lost),
        )
    return written


def check_name(argument: str, path: Any) -> None:
    """Refuse what is no name of a calibration file that `StereoCalibration.save` writes. Raises InvalidArgument."""
    path = file_name(argument, path)
    if writer_of(path) is None and path.suffix.lower() not in native.ENDINGS:
        raise InvalidArgument(argument, f"must end in one of {', '.join((*native.ENDINGS, *WRITERS))}", str(path))


def _write_opencv(calibration: StereoCalibration, path: Path) -> list[Path]:
    write_text(path, _opencv(calibration))
    return [path]


def _write_ros(calibration: StereoCalibration, path: Path) -> list[Path]:
    stem = path.name[: -len(ROS_ENDING)]
    files = [path.with_name(f"{stem}.{side}{ROS_ENDING}") for side in ("left", "right")]
    for side, file in zip(("left", "right"), files, strict=True):
        write_text(file, _yaml(_ros(calibration, side)))
    return files


def _write_kalibr(calibration: StereoCalibration, path: Path) -> list[Path]:
    write_text(path, _yaml(_kalibr(calibration)))
    return [path]


WRITERS: dict[str, Writer] = {".opencv.yaml": _write_opencv, ROS_ENDING: _write_ros, ".kalibr.yaml": _write_kalibr}


def _opencv(calibration: StereoCalibration) -> str:
    import cv2

    from endosdk.calibration.q_matrix import has_square_pixels, q_matrix

    c, g = calibration, calibration.rectification()
    storage = cv2.FileStorage("rig.yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", c.width)
    storage.write("image_height", c.height)
    storage.write("distortion_model", c.model)
    for name, value in {
        **{"K1": c.left_matrix, "D1": _row(c.left_distortion), "K2": c.right_matrix, "D2": _row(c.right_distortion)},
        **{"R": c.rotation, "T": c.translation.reshape(3, 1), "R1": g.R1, "R2": g.R2, "P1": g.P1, "P2": g.P2},
        **({"Q": q_matrix(g)} if has_square_pixels(g) else {}),
    }.items():
        storage.write(name, np.ascontiguousarray(value))
    text = storage.releaseAndGetString()
    return str(text)


def _row(distortion: Any) -> Any:
    return (distortion if distortion.size else np.zeros(4)).reshape(1, -1)


def _kalibr(calibration: StereoCalibration) -> dict[str, Any]:
    c = calibration
    transform = np.eye(4)
    transform[:3, :3] = c.rotation
    transform[:3, 3] = c.translation / MM_PER_UNIT["m"]
    return {
        "cam0": _kalibr_camera(c, c.left_matrix, c.left_distortion),
        "cam1": {**_kalibr_camera(c, c.right_matrix, c.right_distortion), "T_cn_cnm1": transform.tolist()},
    }


def _kalibr_camera(calibration: StereoCalibration, matrix: Any, distortion: Any) -> dict[str, Any]:
    if distortion.size > 4 and distortion[4:].any():
        rule = "must have no more than four coefficients for a camchain; export to OpenCV or ROS"
        raise InvalidArgument("distortion", rule, distortion.tolist())
    return {
        "camera_model": "pinhole",
        "intrinsics": [float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2))],
        "distortion_model": "equidistant" if calibration.model == "fisheye" else "radtan",
        "distortion_coeffs": _row(distortion)[0, :4].tolist(),
        "resolution": [calibration.width, calibration.height],
    }


def _ros(calibration: StereoCalibration, side: str) -> dict[str, Any]:
    info = camera_info(calibration, calibration.rectification(), side)
    return {
        "image_width": calibration.width,
        "image_height": calibration.height,
        "camera_name": side,
        "camera_matrix": _ros_matrix(info.matrix),
        "distortion_model": info.distortion_model,
        "distortion_coefficients": _ros_matrix(info.distortion.reshape(1, -1)),
        "rectification_matrix": _ros_matrix(info.rectification),
        "projection_matrix": _ros_matrix(info.projection),
    }


def _ros_matrix(values: Any) -> dict[str, Any]:
    return {"rows": values.shape[0], "cols": values.shape[1], "data": values.ravel().tolist()}


def _yaml(content: dict[str, Any]) -> str:
    return yaml.dump(content, Dumper=NumbersInLines, sort_keys=False, width=120)
