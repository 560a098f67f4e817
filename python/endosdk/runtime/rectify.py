"""Rectify a pair without a model, for tools and studies."""

from __future__ import annotations

from typing import Any

from endosdk import _core
from endosdk.calibration.rig import StereoCalibration
from endosdk.runtime.arguments import Picture, check_pair


def rectified(left: Picture, right: Picture, calibration: StereoCalibration) -> tuple[Picture, Picture]:
    """Return the rectified views at the size of the frames, RGB uint8 [H, W, 3], as `DepthEstimator.rectify`."""
    return _core.rectified_views(*check_pair(left, right), rig_numbers(calibration))


def rig_numbers(rig: StereoCalibration) -> tuple[Any, ...]:
    """Return a rig as the core takes it."""
    left, right = (rig.left_matrix, rig.left_distortion), (rig.right_matrix, rig.right_distortion)
    fields = (field or (0.0, 0.0, 0.0, 0.0) for field in (rig.left_field_of_view, rig.right_field_of_view))
    return rig.model, rig.width, rig.height, *left, *right, rig.rotation, rig.translation, *fields
