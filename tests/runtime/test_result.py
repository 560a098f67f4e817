"""What a result, an estimator and a rig say of themselves to people."""

from endosdk import DepthEstimator, StereoCalibration
from endosdk.runtime.result import Cause, Status
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import fisheye_rig


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


def test_an_estimator_is_printed_in_one_line():
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    estimator = DepthEstimator(str(TINY_MODEL), calibration=rig, threads=1)
    said = "<DepthEstimator tiny-for-tests 1: CPUExecutionProvider, 1 thread, calibrated for 160x96>"
    assert repr(estimator) == str(estimator) == said
    estimator.close()
    assert repr(estimator) == said
    assert repr(DepthEstimator(str(TINY_MODEL), threads=3)).endswith("3 threads, no calibration>")
    usual = DepthEstimator(str(TINY_MODEL))
    assert f" {usual.diagnostics()['threads']} thread" in repr(usual)


def test_a_rig_is_printed_in_one_line():
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    said = "<StereoCalibration 160x96, pinhole, rectified: focal length 200.0 px, baseline 5.00 mm, SHA-256 "
    assert repr(rig) == f"{said}{rig.sha256[:12]}...>"
    assert repr(fisheye_rig()).startswith("<StereoCalibration 640x480, fisheye: focal length 520.5 px, baseline 4.61")


def test_words_are_printed_as_words():
    assert str(Status.OK) == "OK"
    assert str(Cause.SAME_VIEW_TWICE) == "SAME_VIEW_TWICE"
    assert Status.OK == 0
