"""The rectified geometry of a pair, and what resizing and cropping do to a projection.

Lengths are millimetres, and image coordinates put (0, 0) at the centre of the first pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rules import check_crop, check_size, finite_array
from endosdk.errors import InvalidCalibration

Matrix = npt.NDArray[np.float64]
Values = TypeVar("Values", npt.NDArray[np.float32], npt.NDArray[np.float64])


@dataclass(frozen=True, eq=False)
class RectifiedGeometry:
    """Rectifying rotations [3,3], projections [3,4] (OpenCV's R1, R2, P1, P2; mm) and the rectified picture's size."""

    R1: Matrix
    R2: Matrix
    P1: Matrix
    P2: Matrix
    width: int
    height: int

    def __post_init__(self) -> None:
        for name, columns in (("R1", 3), ("R2", 3), ("P1", 4), ("P2", 4)):
            object.__setattr__(self, name, finite_array(name, getattr(self, name), (3, columns)))
        if not (self.focal_px > 0 and self.baseline_mm > 0):
            rule = "must leave a positive focal length and baseline after rectification"
            raise InvalidCalibration("rectification", rule, (self.focal_px, self.baseline_mm))

    @property
    def focal_px(self) -> float:
        """Horizontal focal length of the rectified pair in pixels, the one that depth needs."""
        return float(self.P1[0, 0])

    @property
    def focal_y_px(self) -> float:
        """Vertical focal length in pixels; it differs where pixels are not square, as in half-width video."""
        return float(self.P1[1, 1])

    @property
    def baseline_mm(self) -> float:
        """Distance between the rectified cameras in mm."""
        return float(-self.P2[0, 3] / self.P2[0, 0])

    @property
    def cx(self) -> float:
        """Principal point of the left rectified view, column."""
        return float(self.P1[0, 2])

    @property
    def cy(self) -> float:
        """Principal point of both rectified views, row."""
        return float(self.P1[1, 2])

    @property
    def doffs(self) -> float:
        """Right cx minus left cx in pixels: ``depth = focal_px * baseline_mm / (disparity + doffs)``."""
        return float(self.P2[0, 2] - self.P1[0, 2])

    def depth_of(self, disparity: Values) -> Values:
        """Return the depth in mm of disparities in px, of any shape; what lies at infinity or behind is no depth."""
        return self.focal_px * self.baseline_mm / (disparity + self.doffs)

    def disparity_of(self, depth: Values) -> Values:
        """Return the disparity in px of depths in mm, of any shape."""
        return self.focal_px * self.baseline_mm / depth - self.doffs

    def scaled(self, width: int, height: int) -> RectifiedGeometry:
        """Return the geometry of the rectified pair resized to ``width`` x ``height``."""
        new_width, new_height = check_size("size", (width, height))
        scale = new_width / self.width, new_height / self.height
        return RectifiedGeometry(
            self.R1, self.R2, scale_rows(self.P1, *scale), scale_rows(self.P2, *scale), new_width, new_height
        )

    def cropped(self, x: int, y: int, width: int, height: int) -> RectifiedGeometry:
        """Return the geometry of the window at (x, y) that is cut out of both rectified views."""
        x, y, width, height = check_crop((x, y, width, height), (self.width, self.height))
        return RectifiedGeometry(
            self.R1, self.R2, shift_centre(self.P1, x, y), shift_centre(self.P2, x, y), width, height
        )


def scale_rows(projection: Matrix, scale_x: float, scale_y: float) -> Matrix:
    """Scale a 3x3 or 3x4 projection; pixel centres are whole numbers, hence the half pixel: c' = (c + 0.5) k - 0.5."""
    scaled = projection.copy()
    scaled[0] *= scale_x
    scaled[1] *= scale_y
    scaled[0, 2] += 0.5 * scale_x - 0.5
    scaled[1, 2] += 0.5 * scale_y - 0.5
    return scaled


def shift_centre(projection: Matrix, x: int, y: int) -> Matrix:
    """Return a 3x3 or 3x4 projection of the window whose first pixel is (x, y)."""
    shifted = projection.copy()
    shifted[0, 2] -= x
    shifted[1, 2] -= y
    return shifted
