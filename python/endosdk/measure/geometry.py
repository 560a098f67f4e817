"""Between raw and rectified pixels, rectified and raw cameras, and OpenCV's Q."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.calibration.rig import RectifiedGeometry, StereoCalibration
from endosdk.errors import InvalidArgument

Matrix = npt.NDArray[np.float64]
Side = Literal["left", "right"]

NEWTON_STEPS = 4
STEP_PX = 1e-3  # for slopes by differences


def raw_to_rectified(
    calibration: StereoCalibration, pixels: npt.ArrayLike, side: Side = "left", alpha: float = 0.0
) -> Matrix:
    """Return where raw pixels [..., 2] lie in the rectified view of that side, float64 [..., 2].

    ``alpha`` is that of `StereoCalibration.rectification`.
    """
    points = _checked(pixels)
    flat = points.reshape(-1, 2)
    found = _undistorted(calibration, flat, side, alpha)
    # OpenCV stops after five steps, which is up to a pixel away at the edge of an endoscope's view: go on by Newton's.
    for _ in range(NEWTON_STEPS):
        here = rectified_to_raw(calibration, found, side, alpha)
        slopes = np.stack(
            [
                (rectified_to_raw(calibration, found + step, side, alpha) - here) / STEP_PX
                for step in STEP_PX * np.eye(2)
            ],
            axis=-1,
        )
        found = found + np.linalg.solve(slopes, (flat - here)[..., None])[..., 0]
    return found.reshape(points.shape)


def _undistorted(calibration: StereoCalibration, flat: Matrix, side: Side, alpha: float) -> Matrix:
    """Return OpenCV's answer for raw pixels [n,2]."""
    import cv2

    matrix, distortion, turn, view = _camera(calibration, side, alpha)
    if calibration.model == "fisheye":
        found = cv2.fisheye.undistortPoints(flat[:, None], matrix, _fisheye(distortion), R=turn, P=view)
    else:
        found = cv2.undistortPoints(flat[:, None], matrix, _brown(distortion), R=turn, P=view)
    return np.asarray(found, np.float64).reshape(-1, 2)


def rectified_to_raw(
    calibration: StereoCalibration, pixels: npt.ArrayLike, side: Side = "left", alpha: float = 0.0
) -> Matrix:
    """Return where pixels [..., 2] of the rectified view of that side come from in the raw view, float64 [..., 2]."""
    import cv2

    matrix, distortion, turn, view = _camera(calibration, side, alpha)
    points = _checked(pixels)
    flat = points.reshape(-1, 2)
    sights = np.column_stack([(flat - view[:2, 2]) / view[[0, 1], [0, 1]], np.ones(len(flat))]) @ turn  # R^T, by rows
    none = np.zeros(3)
    if calibration.model == "fisheye":
        found, _ = cv2.fisheye.projectPoints(sights[:, None], none, none, matrix, _fisheye(distortion))
    else:
        found, _ = cv2.projectPoints(sights[:, None], none, none, matrix, _brown(distortion))
    return np.asarray(found, np.float64).reshape(points.shape)


def points_in_raw_left_camera(geometry: RectifiedGeometry, points: npt.ArrayLike) -> Matrix:
    """Turn points [..., 3], mm, of the rectified left camera's frame into that of the raw left camera; float64.

    A hand-eye calibration knows the raw camera.
    """
    array = np.asarray(points, np.float64)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise InvalidArgument("points", "must be [..., 3]", array.shape)
    return np.asarray(array @ geometry.R1)  # R1 turns raw into rectified; by rows, this is its inverse


def q_matrix(geometry: RectifiedGeometry) -> Matrix:
    """Return OpenCV's Q [4,4]: ``Q @ (x, y, disparity, 1)`` is the point, homogeneous, mm.

    Raises InvalidArgument where pixels are not square: Q cannot say that.
    """
    if abs(geometry.focal_px - geometry.focal_y_px) > 1e-6 * geometry.focal_px:
        rule = "must have square pixels, which Q takes for granted; use DepthResult.points"
        raise InvalidArgument("geometry", rule, (geometry.focal_px, geometry.focal_y_px))
    q = np.zeros((4, 4))
    q[0, 0] = q[1, 1] = 1.0
    q[:3, 3] = -geometry.cx, -geometry.cy, geometry.focal_px
    q[3, 2] = 1.0 / geometry.baseline_mm
    q[3, 3] = geometry.doffs / geometry.baseline_mm
    return q


def valid_region(calibration: StereoCalibration, alpha: float = 0.0) -> tuple[int, int, int, int]:
    """Return (x, y, width, height) of a large rectangle in the rectified left view that both cameras cover.

    It is the largest rectangle of pixels for which both rectified views, at the same place, have a source.
    """
    c, g = calibration, calibration.rectification(alpha=alpha)
    if c.is_rectified:
        return 0, 0, c.width, c.height
    rectifier = _core.Rectifier(
        c.width,
        c.height,
        g.width,
        g.height,
        (c.model, c.left_matrix, c.left_distortion, g.R1, g.P1),
        (c.model, c.right_matrix, c.right_distortion, g.R2, g.P2),
        False,
    )
    return _largest_rectangle((rectifier.valid_left != 0) & (rectifier.valid_right != 0))


def _largest_rectangle(mask: npt.NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Return the largest rectangle of a mask, by the histogram of each row's columns above."""
    best = (0, 0, 0, 0)
    heights = np.zeros(mask.shape[1] + 1, int)
    for row, line in enumerate(mask):
        heights[:-1] = np.where(line, heights[:-1] + 1, 0)
        open_columns: list[tuple[int, int]] = []  # (first column, height), rising
        for column, height in enumerate(heights.tolist()):
            first = column
            while open_columns and open_columns[-1][1] >= height:
                first, tall = open_columns.pop()
                if tall * (column - first) > best[2] * best[3]:
                    best = first, row - tall + 1, column - first, tall
            open_columns.append((first, height))
    return best


def _camera(calibration: StereoCalibration, side: Side, alpha: float) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return camera matrix, distortion, rectifying rotation and the rectified camera matrix [3,3] of one side."""
    if side not in ("left", "right"):
        raise InvalidArgument("side", "must be left or right", repr(side))
    geometry = calibration.rectification(alpha=alpha)
    if side == "left":
        return calibration.left_matrix, calibration.left_distortion, geometry.R1, geometry.P1[:, :3]
    return calibration.right_matrix, calibration.right_distortion, geometry.R2, geometry.P2[:, :3]


def _checked(pixels: npt.ArrayLike) -> Matrix:
    array = np.asarray(pixels, np.float64)
    if array.ndim < 1 or array.shape[-1] != 2 or not np.isfinite(array).all():
        raise InvalidArgument("pixels", "must be finite (x, y), [..., 2]", array.shape)
    return array


def _brown(distortion: Matrix) -> Matrix:
    return distortion if distortion.size else np.zeros(4)


def _fisheye(distortion: Matrix) -> Matrix:
    return (distortion if distortion.size else np.zeros(4)).reshape(4, 1)
