"""Bad input of the estimator: what is said of it, and that the estimator stays usable."""

import numpy as np
import pytest

from endosdk import DepthEstimator, errors
from tests.conftest import TINY_MODEL, shifted_pair
from tests.runtime.plane import SHIFT, rectified_rig

GOOD = np.zeros((16, 32, 3), np.uint8)


@pytest.mark.parametrize(
    ("left", "right", "argument"),
    [
        ([[1]], GOOD, "left"),
        (GOOD.astype(np.float32), GOOD, "left"),
        (GOOD, GOOD.astype(np.uint16), "right"),
        (np.zeros((16, 32, 4), np.uint8), GOOD, "left"),
        (np.zeros((2, 16, 32, 3), np.uint8), GOOD, "left"),
        (np.zeros((0, 32, 3), np.uint8), np.zeros((0, 32, 3), np.uint8), "left"),
        (GOOD, np.zeros((16, 31, 3), np.uint8), "right"),
        (GOOD, np.zeros((16, 32), np.uint8), "right"),
        (GOOD, None, "right"),
    ],
)
def test_bad_frames_are_refused_and_the_estimator_lives(pair, left, right, argument):
    estimator = DepthEstimator(TINY_MODEL)
    expected = estimator.predict(*pair).disparity
    with pytest.raises(errors.InvalidArgument) as caught:
        estimator.predict(left, right)
    assert caught.value.argument == argument
    assert np.array_equal(estimator.predict(*pair).disparity, expected)


def test_calibration_for_another_size_is_refused(pair):
    estimator = DepthEstimator(TINY_MODEL, calibration=rectified_rig(320, 192))
    with pytest.raises(errors.CalibrationSizeMismatch, match="160x96"):
        estimator.predict(*pair)
    assert estimator.predict(*shifted_pair(192, 320, SHIFT)).disparity.shape == (192, 320)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("channel_order", "hsv"),
        ("min_confidence", 1.5),
        ("min_confidence", float("nan")),
        ("depth_range_mm", (50.0, 20.0)),
        ("network_size", (0, 10)),
        ("threads", 0),
        ("calibration", "rig.yaml"),
        ("channel_order", None),
        ("min_confidence", "0.5"),
        ("min_confidence", None),
        ("depth_range_mm", 5),
        ("depth_range_mm", (1.0, 2.0, 3.0)),
        ("depth_range_mm", ("1", "2")),
        ("network_size", "480x360"),
        ("network_size", 480),
        ("network_size", (480.5, 360)),
        ("network_size", (float("inf"), 360)),
        ("network_size", (10**7, 10**7)),
        ("threads", float("nan")),
        ("threads", 10**400),
        ("deadline_ms", 10**400),
        pytest.param("deadline_ms", 10**5000, id="more digits than Python writes"),
        ("max_age_ms", 10**400),
        ("min_confidence", 10**400),
        ("depth_range_mm", (0, 10**400)),
        ("network_size", (10**400, 360)),
        ("spinning", "no"),
        ("spinning", 0),
        ("threads", 1.5),
        ("threads", 257),
        ("threads", "2"),
        ("provider", None),
        ("provider", ["cpu"]),
    ],
)
def test_bad_settings_are_refused(argument, value):
    with pytest.raises(errors.InvalidArgument) as caught:
        DepthEstimator(TINY_MODEL, **{argument: value})
    assert caught.value.argument == argument


@pytest.mark.parametrize("argument", ["reuse", "temporal", "follow_rig"])
def test_a_word_is_no_switch_of_a_stream(argument):
    with pytest.raises(errors.InvalidArgument, match=f"^{argument}: must be True or False; got 'no'"):
        DepthEstimator(TINY_MODEL).stream([], **{argument: "no"})


def test_a_stamp_of_any_length_is_refused(pair):
    with pytest.raises(errors.InvalidArgument, match="stamp_ns"):
        DepthEstimator(TINY_MODEL).predict(*pair, stamp_ns=10**5000)


def test_a_depth_range_without_a_calibration_is_refused():
    with pytest.raises(errors.CalibrationRequired, match="depth_range_mm"):
        DepthEstimator(TINY_MODEL, depth_range_mm=(20.0, 200.0))


def test_out_of_another_size_is_refused(pair):
    estimator = DepthEstimator(TINY_MODEL)
    small = estimator.predict(*shifted_pair(64, 128, 4))
    with pytest.raises(errors.InvalidArgument, match="out: must be of frames of this size"):
        estimator.predict(*pair, out=small)


def test_out_that_cannot_be_written_is_refused(pair):
    estimator = DepthEstimator(TINY_MODEL)
    result = estimator.predict(*pair)
    with pytest.raises(errors.InvalidArgument, match="out: must be a DepthResult"):
        estimator.predict(*pair, out=result.disparity)
    with pytest.raises(errors.InvalidArgument, match="without a calibration"):
        estimator.predict(*pair, out=DepthEstimator(TINY_MODEL, calibration=rectified_rig()).predict(*pair))
    result.disparity.flags.writeable = False
    with pytest.raises(errors.InvalidArgument, match="out: must have maps that can be written"):
        estimator.predict(*pair, out=result)
