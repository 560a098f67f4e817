"""A folder of plain text files as surgical vision groups keep it; mm, no picture size.

``calib.left.intrinsic.txt`` and ``calib.right.intrinsic.txt`` hold 3x3 numbers, ``calib.*.distortion.txt`` a row of
coefficients, and one 4x4 transform, named for its direction: ``calib.l2r.*`` takes a left point into the right
camera, ``calib.r2l.*`` the other way about and is inverted here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.calibration.files.stated import RawCalibration, matrix, read_numbers
from endosdk.errors import CalibrationUnreadable, InvalidArgument

Matrix = npt.NDArray[np.float64]

TRANSFORMS = ("calib.l2r.txt", "calib.l2r.4x4", "calib.r2l.txt", "calib.r2l.4x4")


def read(paths: tuple[Path, ...]) -> RawCalibration:
    """Read the folder."""
    if len(paths) != 1 or not paths[0].is_dir():
        raise InvalidArgument("path", "the text layout is one folder", [str(path) for path in paths])
    folder = paths[0]
    rotation, translation = _left_to_right(folder)
    return RawCalibration(
        left_matrix=_numbers(folder, "calib.left.intrinsic.txt", (3, 3)),
        right_matrix=_numbers(folder, "calib.right.intrinsic.txt", (3, 3)),
        left_distortion=_numbers(folder, "calib.left.distortion.txt", (-1,)),
        right_distortion=_numbers(folder, "calib.right.distortion.txt", (-1,)),
        rotation=rotation,
        translation=translation,
        size=None,
        unit="mm",
    )


def _numbers(folder: Path, name: str, shape: tuple[int, ...]) -> Matrix:
    path = folder / name
    if not path.is_file():
        raise CalibrationUnreadable(folder.name, f"must hold {name}", "no such file")
    return matrix(path, "content", [part for row in read_numbers(path) for part in row], shape)


def _left_to_right(folder: Path) -> tuple[Matrix, Matrix]:
    present = [name for name in TRANSFORMS if (folder / name).is_file()]
    if len(present) != 1:
        raise CalibrationUnreadable(folder.name, f"must hold one of {', '.join(TRANSFORMS)}", present or "none")
    transform = _numbers(folder, present[0], (4, 4))
    last = transform[3].tolist()
    if last != [0.0, 0.0, 0.0, 1.0]:
        raise CalibrationUnreadable(f"{folder.name}/{present[0]}", "must end with the row 0 0 0 1", last)
    rotation, translation = transform[:3, :3], transform[:3, 3]
    if present[0].startswith("calib.l2r"):
        return rotation, translation
    return rotation.T, -rotation.T @ translation
