"""The one file every wheel must pass: seconds, offline, nothing but the installed package and pytest."""

import math

import numpy as np
import pytest

import endosdk


def smooth_pair(height: int, width: int, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """A textured plane seen by both cameras: right[x - shift] == left[x]."""
    y, x = np.mgrid[:height, : width + shift].astype(np.float64)
    waves = [
        math.cos(k) * np.sin(x / (3.1 + k) + 1.7 * k) * np.cos(y / (4.3 + 0.6 * k) + k * k)
        for k in (0.0, 1.3, 2.9, 5.1)
    ]
    picture = np.stack([150 + 22 * sum(waves), 85 + 25 * waves[0] + 20 * waves[2], 80 + 24 * waves[1]], axis=-1)
    picture = np.clip(picture, 0, 245).astype(np.uint8)
    return picture[:, :width].copy(), picture[:, shift:].copy()


@pytest.mark.parametrize("name", sorted(endosdk.shipped_models()))
def test_shipped_model_sees_a_plane_at_its_depth(name):
    rig = endosdk.StereoCalibration.rectified(focal_px=400.0, baseline_mm=5.0, size=(320, 192))
    estimator = endosdk.DepthEstimator(name, calibration=rig)
    result = estimator.predict(*smooth_pair(192, 320, 24))
    middle = result.disparity[48:-48, 110:-40]
    assert np.median(middle) == pytest.approx(24, abs=1.5)
    assert np.median(rig.baseline_mm * 400 / middle) == pytest.approx(83.3, rel=0.07)
    assert np.array_equal(np.isnan(result.depth), result.reasons != 0)


def test_bad_input_has_a_code():
    with pytest.raises(ValueError, match="uint8") as caught:
        endosdk.DepthEstimator(next(iter(endosdk.shipped_models()))).predict(np.zeros((8, 8, 3)), np.zeros((8, 8, 3)))
    assert caught.value.code is endosdk.ErrorCode.INVALID_ARGUMENT
