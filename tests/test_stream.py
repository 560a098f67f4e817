import threading
import tracemalloc

import numpy as np
import pytest

from endosdk import DepthEstimator, errors
from tests.conftest import TINY_MODEL, shifted_pair

SIZE = (96, 160)


def pairs(count=5):
    return [shifted_pair(*SIZE, 4 * number + 4) for number in range(count)]


def streaming_threads():
    return [thread for thread in threading.enumerate() if thread.name.startswith("endosdk-stream")]


def test_stream_gives_what_predict_gives_in_order():
    estimator = DepthEstimator(TINY_MODEL)
    expected = [estimator.predict(*pair) for pair in pairs()]
    found = list(estimator.stream(iter(pairs())))
    assert [result.frame for result in found] == [6, 7, 8, 9, 10]
    for a, b in zip(expected, found, strict=True):
        np.testing.assert_array_equal(a.disparity, b.disparity)
        np.testing.assert_array_equal(a.confidence, b.confidence)
        np.testing.assert_array_equal(a.reasons, b.reasons)
        assert b.timings.rectify_ms > 0


def test_an_empty_stream_ends_at_once():
    assert list(DepthEstimator(TINY_MODEL).stream([])) == []


def test_no_more_than_one_pair_is_fetched_ahead():
    drawn = 0

    def source():
        nonlocal drawn
        for pair in pairs(10):
            drawn += 1
            yield pair

    stream = DepthEstimator(TINY_MODEL).stream(source())
    for number in range(1, 4):
        next(stream)
        assert drawn <= number + 1
    stream.close()
    assert streaming_threads() == []


def test_predict_between_two_frames_does_not_disturb_the_stream():
    estimator = DepthEstimator(TINY_MODEL)
    expected = [estimator.predict(*pair).disparity for pair in pairs()]
    for number, result in enumerate(estimator.stream(pairs())):
        np.testing.assert_array_equal(result.disparity, expected[number])
        np.testing.assert_array_equal(estimator.predict(*pairs()[0]).disparity, expected[0])


def failing_source():
    yield from pairs(2)
    raise ConnectionError("the camera is gone")


@pytest.mark.parametrize(
    ("source", "error", "good"),
    [
        (failing_source, ConnectionError, 2),
        (lambda: [*pairs(2), (np.zeros((96, 160, 3), np.float32),) * 2], errors.InvalidArgument, 2),
        (lambda: [*pairs(1), shifted_pair(64, 160, 4)], errors.InvalidArgument, 1),
    ],
    ids=["source", "type", "size"],
)
def test_an_error_comes_in_its_turn_and_the_estimator_lives(source, error, good):
    estimator = DepthEstimator(TINY_MODEL)
    seen = []
    with pytest.raises(error):
        for result in estimator.stream(source()):
            seen.append(result)
    assert len(seen) == good
    assert streaming_threads() == []
    assert estimator.predict(*pairs(1)[0]).disparity.shape == SIZE


def largest_growth(step, frames=5):
    """Bytes of Python and NumPy memory, at most, by which any of some frames grows what is in use while it lasts."""
    for _ in range(3):
        step()
    tracemalloc.start()
    try:
        growth = []
        for _ in range(frames):
            tracemalloc.reset_peak()
            before = tracemalloc.get_traced_memory()[0]
            step()
            growth.append(tracemalloc.get_traced_memory()[1] - before)
        return max(growth)
    finally:
        tracemalloc.stop()


def test_no_map_is_allocated_per_frame_when_memory_is_reused():
    smallest_map = SIZE[0] * SIZE[1]  # the reasons: a byte a pixel
    estimator = DepthEstimator(TINY_MODEL)
    left, right = pairs(1)[0]
    result = estimator.predict(left, right)
    assert largest_growth(lambda: estimator.predict(left, right, out=result)) < smallest_map / 2
    stream = estimator.stream(((left, right) for _ in range(100)), reuse=True)
    assert largest_growth(lambda: next(stream)) < smallest_map / 2
    stream.close()
    # The ruler itself: without reuse every frame brings its maps.
    assert largest_growth(lambda: estimator.predict(left, right)) > 9 * smallest_map
