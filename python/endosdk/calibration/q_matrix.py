"""OpenCV's matrix Q, from disparity to points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration, check_calibration
from endosdk.errors import InvalidArgument

Matrix = npt.NDArray[np.float64]


def has_square_pixels(geometry: RectifiedGeometry) -> bool:
    """Whether both focal lengths are one, as Q takes for granted."""
    return abs(geometry.focal_px - geometry.focal_y_px) <= 1e-6 * geometry.focal_px


def q_matrix(geometry: RectifiedGeometry | StereoCalibration) -> Matrix:
    """Return OpenCV's Q [4,4]: ``Q @ (x, y, disparity, 1)`` is the point, homogeneous, mm.

    ``geometry`` is that of rectified pairs, or a rig, which then is rectified as the SDK does it.
    Raises InvalidArgument where pixels are not square: Q cannot say that.
    """
    if not isinstance(geometry, RectifiedGeometry):
        geometry = check_calibration(geometry).rectification()
    if not has_square_pixels(geometry):
        rule = "must have square pixels, which Q takes for granted; use DepthResult.points"
        raise InvalidArgument("geometry", rule, (geometry.focal_px, geometry.focal_y_px))
    q = np.zeros((4, 4))
    q[0, 0] = q[1, 1] = 1.0
    q[:3, 3] = -geometry.cx, -geometry.cy, geometry.focal_px
    q[3, 2] = 1.0 / geometry.baseline_mm
    q[3, 3] = geometry.doffs / geometry.baseline_mm
    return q
