"""The memory of maps: taken again for a later frame, and never while anything looks at it."""

import tracemalloc
from contextlib import closing, contextmanager

import numpy as np

from endosdk import DepthEstimator
from tests.conftest import TINY_MODEL, shifted_pair

SIZE = (96, 160)
SMALLEST_MAP = SIZE[0] * SIZE[1]  # bytes: the reasons, one a pixel
ALL_MAPS = 9 * SMALLEST_MAP  # without a calibration: two of floats and the reasons


def pairs(count):
    return [shifted_pair(*SIZE, 4 * number + 4) for number in range(count)]


@contextmanager
def traced_memory():
    """Trace Python's and NumPy's memory. Streams begin and end inside: to stop while a thread allocates is a crash."""
    tracemalloc.start()
    try:
        yield
    finally:
        tracemalloc.stop()


def largest_growth(step, frames=5):
    """Bytes of Python and NumPy memory, at most, by which any of some frames grows what is in use while it lasts."""
    for _ in range(3):
        step()
    growth = []
    for _ in range(frames):
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        step()
        growth.append(tracemalloc.get_traced_memory()[1] - before)
    return max(growth)


def test_no_map_is_allocated_per_frame_unless_results_are_kept():
    estimator = DepthEstimator(TINY_MODEL)
    left, right = pairs(1)[0]
    result = estimator.predict(left, right)
    kept = []
    with traced_memory():
        assert largest_growth(lambda: estimator.predict(left, right, out=result)) < SMALLEST_MAP / 2
        assert largest_growth(lambda: estimator.predict(left, right)) < SMALLEST_MAP / 2
        with closing(estimator.stream(((left, right) for _ in range(100)), reuse=True)) as stream:
            assert largest_growth(lambda: next(stream)) < SMALLEST_MAP / 2
        # The ruler itself: where results are kept, every frame brings its maps.
        assert largest_growth(lambda: kept.append(estimator.predict(left, right))) > ALL_MAPS


def test_what_anything_refers_to_is_not_written_again():
    estimator = DepthEstimator(TINY_MODEL)
    (left, right), (other, _) = pairs(2)
    result = estimator.predict(left, right)
    part = result.disparity[2:5, ::2].T  # looks at the map, and does not know the result
    before = part.copy()
    memory = result.disparity.ctypes.data
    del result
    kept = [estimator.predict(other, right) for _ in range(3)]
    assert np.array_equal(part, before)
    assert not any(np.shares_memory(part, each.disparity) for each in kept)
    del part
    assert estimator.predict(left, right).disparity.ctypes.data == memory


def test_frames_of_another_size_bring_maps_of_theirs():
    estimator = DepthEstimator(TINY_MODEL)
    left, right = pairs(1)[0]
    for rows in (SIZE[0], SIZE[0] - 8, SIZE[0]):
        assert estimator.predict(left[:rows], right[:rows]).disparity.shape == (rows, SIZE[1])


def test_a_closed_estimator_keeps_no_maps():
    estimator = DepthEstimator(TINY_MODEL)
    with traced_memory():
        before = tracemalloc.get_traced_memory()[0]
        result = estimator.predict(*pairs(1)[0])
        estimator.close()
        assert tracemalloc.get_traced_memory()[0] - before > ALL_MAPS
        del result
        assert tracemalloc.get_traced_memory()[0] - before < SMALLEST_MAP
