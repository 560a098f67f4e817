"""A textured plane as two cameras see it: the pair on which what the estimator answers is known."""

from endosdk import StereoCalibration

WIDTH, HEIGHT, SHIFT = 160, 96, 12  # px; the plane's disparity is the last


def rectified_rig(width=WIDTH, height=HEIGHT):
    return StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(width, height))
