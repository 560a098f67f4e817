"""What the numbers of a calibration must satisfy. Each check returns the value in its final type or raises."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.errors import CalibrationSizeMismatch, InvalidArgument, InvalidCalibration

Matrix = npt.NDArray[np.float64]
Ellipse = tuple[float, float, float, float]  # middle x, y and half axes along x and y, px
CameraModel = Literal["pinhole", "fisheye"]


def _plain(value: Any) -> float:
    """Return a real number as float, NaN for what is none."""
    try:
        return math.nan if isinstance(value, bool) or not isinstance(value, Real) else float(value)
    except OverflowError:  # a whole number of more digits than a float has room for
        return math.inf


def number(name: str, value: Any) -> float:
    """Return a finite real number as float."""
    plain = _plain(value)
    if not math.isfinite(plain):
        raise InvalidCalibration(name, "must be a finite number", repr(value))
    return plain


def finite_array(name: str, value: Any, shape: tuple[int, ...] | None = None) -> Matrix:
    """Return a read-only contiguous float64 copy of finite numbers, of the given shape if there is one."""
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidCalibration(name, "must be an array of numbers", repr(value)) from error
    if shape is not None and array.shape != shape:
        raise InvalidCalibration(name, f"must have shape {list(shape)}", list(array.shape))
    if not np.isfinite(array).all():
        raise InvalidCalibration(name, "must be finite", array.tolist())
    array += 0.0  # makes -0.0 to 0.0: equal rigs have one hash
    array.flags.writeable = False
    return array


def check_size(name: str, value: Any) -> tuple[int, int]:
    """Return a picture size (width, height) as two ints.

    The least side is 2, because the rectifier interpolates between pixels. The longest is that of frames.
    """
    try:
        width, height = value
    except (TypeError, ValueError) as error:
        raise InvalidArgument(name, "must be (width, height)", repr(value)) from error
    for side in (width, height):
        if isinstance(side, bool) or not isinstance(side, Integral) or not 2 <= int(side) <= _core.longest_side:
            rule = f"must be two whole numbers, 2 to {_core.longest_side} (width, height)"
            raise InvalidArgument(name, rule, repr(value))
    return int(width), int(height)


def check_crop(window: tuple[int, int, int, int], size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return (x, y, width, height) of a window that lies inside a picture of ``size``."""
    x, y, width, height = window
    whole = all(isinstance(part, Integral) and not isinstance(part, bool) for part in window)
    if not whole or x < 0 or y < 0 or width <= 0 or height <= 0 or x + width > size[0] or y + height > size[1]:
        rule = f"(x, y, width, height) must be whole numbers inside the {size[0]}x{size[1]} picture"
        raise InvalidArgument("crop", rule, window)
    return int(x), int(y), int(width), int(height)


def check_alpha(value: Any) -> float:
    """Return OpenCV's free scaling parameter: 0..1, or -1."""
    alpha = _plain(value)
    if not (alpha == -1 or 0 <= alpha <= 1):
        raise InvalidArgument("alpha", "must be in 0..1, or -1", repr(value))
    return alpha


def check_camera_matrix(name: str, value: Any) -> Matrix:
    """Return a 3x3 camera matrix: fx, fy > 0, no skew, last row (0, 0, 1)."""
    matrix = finite_array(name, value, (3, 3))
    _core.check_camera_matrix(matrix, name)
    return matrix


def check_distortion(name: str, value: Any, model: str) -> Matrix:
    """Return a flat vector with as many coefficients as the camera model knows."""
    coefficients = finite_array(name, value)
    if coefficients.ndim != 1:
        raise InvalidCalibration(name, "must be a flat list of coefficients", f"shape {list(coefficients.shape)}")
    _core.check_distortion(coefficients, model == "fisheye", name)
    return coefficients


def check_field_of_view(name: str, value: Any, size: tuple[int, int]) -> Ellipse | None:
    """Return the ellipse that the optics fill in a frame of ``size``; None, and four zeros, stand for none."""
    if value is None:
        return None
    x, y, across, down = finite_array(name, value, (4,)).tolist()
    _core.check_field_of_view((x, y, across, down), *size, name)
    return (x, y, across, down) if (x, y, across, down) != (0.0, 0.0, 0.0, 0.0) else None


def check_rotation(name: str, value: Any) -> Matrix:
    """Return a proper rotation: R R' = I within what files round away, determinant +1."""
    rotation = finite_array(name, value, (3, 3))
    _core.check_rotation(rotation, name)
    return rotation


def check_translation(name: str, value: Any) -> Matrix:
    """Return the translation of a rig whose right camera is on the right: x negative and the larger part."""
    translation = finite_array(name, value, (3,))
    _core.check_translation(translation, name)
    return translation


def check_plausible_baseline(baseline_mm: float) -> None:
    """Refuse a baseline that only a mistaken unit explains."""
    low, high = _core.plausible_baseline_mm
    if not low <= baseline_mm <= high:
        raise InvalidCalibration("baseline", f"must be {low:g} to {high:g} mm", f"{baseline_mm:.6g} mm")


def check_principal_point(side: str, matrix: Matrix, size: tuple[int, int], source: str) -> None:
    """Refuse a size given by hand that leaves a camera's principal point outside its own picture."""
    cx, cy = float(matrix[0, 2]), float(matrix[1, 2])
    if not (0 <= cx < size[0] and 0 <= cy < size[1]):
        rule = f"must be the size {source} was made for: its {side} principal point is ({cx:.1f}, {cy:.1f})"
        raise CalibrationSizeMismatch("size", rule, size)
