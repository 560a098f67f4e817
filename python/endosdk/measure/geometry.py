"""Between raw and rectified pixels, rectified and raw cameras, and OpenCV's Q."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.calibration.q_matrix import q_matrix as q_matrix
from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration, check_calibration
from endosdk.errors import InvalidArgument
from endosdk.runtime.arguments import check_numbers

Matrix = npt.NDArray[np.float64]
Side = Literal["left", "right"]


def raw_to_rectified(
    calibration: StereoCalibration, pixels: npt.ArrayLike, side: Side = "left", alpha: float = 0.0
) -> Matrix:
    """Return where raw pixels [..., 2] lie in the rectified view of that side, float64 [..., 2].

    ``alpha`` is that of `StereoCalibration.rectification`. NaN stays NaN.
    """
    points = _checked(pixels)
    found = _pixel_map(calibration, alpha).to_rectified(_is_right(side), points.reshape(-1, 2))
    return found.reshape(points.shape)


def rectified_to_raw(
    calibration: StereoCalibration, pixels: npt.ArrayLike, side: Side = "left", alpha: float = 0.0
) -> Matrix:
    """Return where pixels [..., 2] of the rectified view of that side come from in the raw view, float64 [..., 2].

    NaN stays NaN, and a pixel whose ray points backwards becomes NaN.
    """
    points = _checked(pixels)
    return _pixel_map(calibration, alpha).to_raw(_is_right(side), points.reshape(-1, 2)).reshape(points.shape)


def points_in_raw_left_camera(geometry: RectifiedGeometry, points: npt.ArrayLike) -> Matrix:
    """Turn points [..., 3], mm, of the rectified left camera's frame into that of the raw left camera; float64.

    A hand-eye calibration knows the raw camera.
    """
    if not isinstance(geometry, RectifiedGeometry):
        rule = "must be a RectifiedGeometry, as StereoCalibration.rectification() gives it"
        raise InvalidArgument("geometry", rule, type(geometry).__name__)
    rule = "must be (x, y, z), [..., 3]"
    array = check_numbers("points", points, rule)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise InvalidArgument("points", rule, f"shape {array.shape}")
    return np.asarray(array @ geometry.R1)  # R1 turns raw into rectified; by rows, this is its inverse


def valid_region(calibration: StereoCalibration, alpha: float = 0.0) -> tuple[int, int, int, int]:
    """Return (x, y, width, height) of the largest rectangle in the rectified left view that both cameras cover.

    At every pixel in it, both rectified views have a source in their raw view.
    """
    x, y, width, height = _pixel_map(calibration, alpha).region()
    return x, y, width, height


def _pixel_map(calibration: StereoCalibration, alpha: float) -> _core.PixelMap:
    check_calibration(calibration).rectification(alpha=alpha)  # refuses what is no alpha
    return _core.PixelMap(calibration.numbers(), alpha)


def _is_right(side: Side) -> bool:
    if side not in ("left", "right"):
        raise InvalidArgument("side", "must be left or right", repr(side))
    return side == "right"


def _checked(pixels: npt.ArrayLike) -> Matrix:
    rule = "must be (x, y), [..., 2]"
    array = check_numbers("pixels", pixels, rule)
    if array.shape == (0,):  # an empty list
        return array.reshape(0, 2)
    if array.ndim < 1 or array.shape[-1] != 2:
        raise InvalidArgument("pixels", rule, f"shape {array.shape}")
    return array
