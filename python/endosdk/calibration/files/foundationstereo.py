"""The two-line text of FoundationStereo: nine numbers of K, then the baseline in metres; for rectified pairs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from endosdk.calibration.files.stated import RawCalibration, matrix, read_numbers
from endosdk.errors import CalibrationUnreadable, InvalidArgument


def looks_like(text: str) -> bool:
    """Whether the text is a row of nine numbers and a row of one."""
    rows = [line.split() for line in text.splitlines() if line.strip()]
    return [len(row) for row in rows] == [9, 1]


def read(paths: tuple[Path, ...]) -> RawCalibration:
    """Read one file; both cameras share K, and the layout holds no picture size."""
    if len(paths) != 1 or paths[0].is_dir():
        raise InvalidArgument("path", "a FoundationStereo calibration is one file", [str(path) for path in paths])
    path = paths[0]
    rows = read_numbers(path)
    if [len(row) for row in rows] != [9, 1]:
        seen = f"rows of {[len(row) for row in rows]}"
        raise CalibrationUnreadable(path.name, "must be a row of nine numbers and a row of one", seen)
    camera = matrix(path, "K", rows[0], (3, 3))
    none = np.zeros(0)
    return RawCalibration(
        left_matrix=camera,
        right_matrix=camera,
        left_distortion=none,
        right_distortion=none,
        rotation=np.eye(3),
        translation=np.array([-rows[1][0], 0.0, 0.0]),
        size=None,
        unit="m",
    )
