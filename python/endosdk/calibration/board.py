"""Calibrate a stereo rig from pictures of a chessboard, with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument

Points = npt.NDArray[np.float64]

# Three poses are the least that fix focal length and principal point; with fewer the solution is arbitrary.
MIN_PAIRS = 3
MIN_CORNERS = 3  # along each side, the least that OpenCV's detector takes
STEPS, CHANGE = 100, 1e-7


@dataclass(frozen=True)
class BoardCalibration:
    """A rig and how well it explains its board pictures, in px.

    ``reprojection_px`` is the root mean square over all corners of both views; the row figures are the median and 95th
    percentile of the rows by which matching corners differ after rectification.
    """

    calibration: StereoCalibration
    reprojection_px: float
    row_median_px: float
    row_p95_px: float


def find_corners(picture: npt.NDArray[np.uint8], pattern: tuple[int, int]) -> Points | None:
    """Return the inner corners [N,2] of a board with (columns, rows) of them, or None. Takes seconds at 1920x1080."""
    import cv2

    if min(pattern) < MIN_CORNERS:
        raise InvalidArgument("pattern", f"must be at least {MIN_CORNERS} x {MIN_CORNERS} inner corners", pattern)
    gray = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    found, corners = cv2.findChessboardCornersSB(gray, pattern, flags=cv2.CALIB_CB_ACCURACY)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2) if found else None


def same_order(left: Points, right: Points) -> Points:
    """Return the right corners in the order of the left ones.

    A board with an even number of corner rows and columns looks the same upside down, so the detector may start at the
    opposite corner in one view. The views of a stereo rig are never turned against each other, which decides it.
    """
    aligned = np.dot(left[-1] - left[0], right[-1] - right[0]) > 0
    return right if aligned else right[::-1].copy()


def calibrate_board(
    left: Sequence[Points], right: Sequence[Points], pattern: tuple[int, int], square_mm: float, size: tuple[int, int]
) -> BoardCalibration:
    """Calibrate from matching corners [N,2] of each pair, for pictures of ``size`` (width, height).

    Each camera alone gives the start; then both are refined together with the pose between them, which on a rig with a
    baseline of a few mm makes rows agree several times better than keeping the single cameras' numbers.
    """
    import cv2

    if len(left) < MIN_PAIRS or len(left) != len(right):
        raise InvalidArgument("pairs", f"must be at least {MIN_PAIRS}, each with both views", (len(left), len(right)))
    if not square_mm > 0:
        raise InvalidArgument("square_mm", "must be positive", square_mm)
    board: list[Any] = [_board_points(pattern, square_mm)] * len(left)
    a, b = ([corners.astype(np.float32).reshape(-1, 1, 2) for corners in side] for side in (left, right))
    # The sixth-order radial term is held at zero: from few poses it grows without making rows agree better.
    fixed = cv2.CALIB_FIX_K3
    _, k1, d1, *_ = cv2.calibrateCamera(board, a, size, None, None, flags=fixed)
    _, k2, d2, *_ = cv2.calibrateCamera(board, b, size, None, None, flags=fixed)
    together = fixed | cv2.CALIB_USE_INTRINSIC_GUESS
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, STEPS, CHANGE)
    error, *solved = cv2.stereoCalibrate(board, a, b, k1, d1, k2, d2, size, flags=together, criteria=stop)
    k1, d1, k2, d2, rotation, translation = (np.asarray(part, dtype=np.float64) for part in solved[:6])
    calibration = StereoCalibration(*size, k1, k2, d1.ravel(), d2.ravel(), rotation, translation.ravel())
    median, p95 = row_correlation(calibration, left, right)
    return BoardCalibration(calibration, float(error), median, p95)


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


def _board_points(pattern: tuple[int, int], square_mm: float) -> npt.NDArray[np.float32]:
    columns, rows = pattern
    corners = np.zeros((rows * columns, 3), np.float32)
    corners[:, 0] = np.tile(np.arange(columns), rows)
    corners[:, 1] = np.repeat(np.arange(rows), columns)
    return corners * np.float32(square_mm)
