"""Rectify a pair without a model, for tools and studies."""

from __future__ import annotations

from endosdk import _core
from endosdk.calibration.rig import StereoCalibration, check_calibration
from endosdk.runtime.arguments import Picture, check_pair


def rectified(left: Picture, right: Picture, calibration: StereoCalibration) -> tuple[Picture, Picture]:
    """Return the rectified views at the size of the frames, RGB uint8 [H, W, 3], as `DepthEstimator.rectify`."""
    return _core.rectified_views(*check_pair(left, right), check_calibration(calibration).numbers())
