"""What a result says of itself to people."""

from endosdk import DepthEstimator, StereoCalibration
from endosdk.runtime.result import Cause, Status
from tests.conftest import TINY_MODEL, shifted_pair


def test_a_result_is_printed_in_one_line():
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    pair = shifted_pair(96, 160, 10)
    said = str(DepthEstimator(str(TINY_MODEL), calibration=rig).predict(*pair))
    assert len(said) < 250
    for part in ("160x96", "frame 1", "% valid", "mm (median", "tiny-for-tests"):
        assert part in said
    assert "no calibration" in str(DepthEstimator(str(TINY_MODEL)).predict(*pair))


def test_a_frame_without_a_valid_pixel_is_printed_too():
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    left, _ = shifted_pair(96, 160, 10)
    result = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(left, left)
    assert "INVALID (" in str(result)
    assert "no depth" in str(result)


def test_words_are_printed_as_words():
    assert str(Status.OK) == "OK"
    assert str(Cause.SAME_VIEW_TWICE) == "SAME_VIEW_TWICE"
    assert Status.OK == 0
