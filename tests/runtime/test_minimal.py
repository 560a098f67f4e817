"""The one file every wheel must pass: seconds, offline, nothing but the installed package and pytest."""

import numpy as np
import pytest

import endosdk
from endosdk.runtime.models import shipped_weights


def smooth_pair(height: int, width: int, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """A blotchy plane, nowhere periodic, seen by both cameras: right[x - shift] == left[x]."""
    rng = np.random.default_rng(0)
    picture = np.full((height, width + shift, 3), (150.0, 85.0, 80.0))
    for cell, strength in ((2, 14.0), (5, 18.0), (16, 24.0)):
        coarse = rng.standard_normal((height // cell + 2, (width + shift) // cell + 2, 3))
        blotches = np.kron(coarse, np.ones((cell, cell, 1)))
        smooth = sum(np.roll(blotches, (dy, dx), (0, 1)) for dy in range(cell) for dx in range(cell)) / cell**2
        picture += strength * smooth[:height, : width + shift]
    picture = np.clip(picture, 0, 245).astype(np.uint8)
    return picture[:, :width].copy(), picture[:, shift:].copy()


@pytest.mark.parametrize("name", sorted(endosdk.shipped_models()))
def test_shipped_model_sees_a_plane_at_its_depth(name):
    rig = endosdk.StereoCalibration.rectified(focal_px=400.0, baseline_mm=5.0, size=(320, 192))
    estimator = endosdk.DepthEstimator(name, calibration=rig)
    result = estimator.predict(*smooth_pair(192, 320, 24))
    middle = result.disparity[48:-48, 110:-40]
    assert np.median(middle) == pytest.approx(24, abs=1.5)
    assert np.nanmedian(result.depth[48:-48, 110:-40]) == pytest.approx(5.0 * 400 / 24, rel=0.07)
    assert np.array_equal(np.isnan(result.depth), result.reasons != 0)


def test_weights_to_train_on_from_are_there():
    kept = {name for name, file in shipped_weights().items() if file.stat().st_size > 100_000}
    assert kept == {"fast", "fast-320", "accurate", "wang2020"}


def test_bad_input_has_a_code():
    with pytest.raises(ValueError, match="uint8") as caught:
        endosdk.DepthEstimator(next(iter(endosdk.shipped_models()))).predict(np.zeros((8, 8, 3)), np.zeros((8, 8, 3)))
    assert caught.value.code is endosdk.ErrorCode.INVALID_ARGUMENT
