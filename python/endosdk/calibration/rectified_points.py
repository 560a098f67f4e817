"""Raw pixels as pixels of the rectified pair, and how well their rows agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import StereoCalibration

Points = npt.NDArray[np.float64]


def row_correlation(
    calibration: StereoCalibration, left: Sequence[Points], right: Sequence[Points]
) -> tuple[float, float]:
    """Return median and 95th percentile in px of the rows by which matching points differ after rectification."""
    pairs = [rectify_points(calibration, a, b) for a, b in zip(left, right, strict=True)]
    rows = np.abs(np.concatenate([a[:, 1] - b[:, 1] for a, b in pairs]))
    return float(np.median(rows)), float(np.percentile(rows, 95))


def rectify_points(calibration: StereoCalibration, left: Points, right: Points) -> tuple[Points, Points]:
    """Return raw pixels [N,2] of both views as pixels of the rectified pair."""
    geometry = calibration.rectification()
    c, g = calibration, geometry
    return (
        _undistort(c.model, left, c.left_matrix, c.left_distortion, g.R1, g.P1),
        _undistort(c.model, right, c.right_matrix, c.right_distortion, g.R2, g.P2),
    )


def _undistort(model: str, points: Points, matrix: Points, distortion: Points, turn: Points, view: Points) -> Points:
    import cv2

    # OpenCV wants writable arrays, and coefficients as a row even where there are none.
    coefficients = (distortion if distortion.size else np.zeros(4)).reshape(1, -1).copy()
    undistort = cv2.undistortPoints if model == "pinhole" else cv2.fisheye.undistortPoints
    flat = undistort(points.reshape(-1, 1, 2), matrix.copy(), coefficients, R=turn.copy(), P=view[:, :3].copy())
    return np.asarray(flat, dtype=np.float64).reshape(-1, 2)
