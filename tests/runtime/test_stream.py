import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from endosdk import DepthEstimator, errors
from endosdk.runtime.result import Cause
from endosdk.runtime.session import BoundRun
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

SIZE = (96, 160)


def small_rig():
    """A raw rig for frames of SIZE."""
    return raw_rig().scaled(SIZE[1], SIZE[0])


def pairs(count=5):
    return [shifted_pair(*SIZE, 4 * number + 4) for number in range(count)]


def streaming_threads():
    return [thread for thread in threading.enumerate() if thread.name.startswith("endosdk-stream")]


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("reuse", [False, True])
def test_stream_gives_what_predict_gives_in_order(threads, reuse):
    estimator = DepthEstimator(TINY_MODEL, threads=threads, calibration=small_rig())
    expected = [estimator.predict(*pair) for pair in pairs(7)]
    count = 0
    for count, (a, b) in enumerate(zip(expected, estimator.stream(iter(pairs(7)), reuse=reuse), strict=True), 1):
        assert b.frame == 7 + count
        for name in ("disparity", "confidence", "reasons", "depth", "sigma"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert b.timings.rectify_ms > 0
        left, _ = estimator.rectified_pair()
        np.testing.assert_array_equal(left, rectified_by_predict(count - 1))
    assert count == 7


def rectified_by_predict(number):
    estimator = DepthEstimator(TINY_MODEL, calibration=small_rig())
    estimator.predict(*pairs(7)[number])
    return estimator.rectified_pair()[0]


def test_results_of_a_stream_are_the_consumers_own():
    results = list(DepthEstimator(TINY_MODEL, threads=2).stream(pairs()))
    assert len({result.disparity.ctypes.data for result in results}) == len(results)


def test_reused_maps_come_round():
    stream = DepthEstimator(TINY_MODEL, threads=2).stream(pairs(10), reuse=True)
    assert len({result.disparity.ctypes.data for result in stream}) == 3


def test_a_function_is_a_source_until_it_returns_none():
    items = iter([*pairs(3), None, *pairs(2)])
    assert len(list(DepthEstimator(TINY_MODEL).stream(lambda: next(items)))) == 3


def test_a_source_may_reuse_its_frames():
    estimator = DepthEstimator(TINY_MODEL, threads=2)
    expected = [estimator.predict(*pair).disparity for pair in pairs()]

    def camera():
        left, right = (np.empty((*SIZE, 3), np.uint8) for _ in range(2))
        for pair in pairs():
            left[:], right[:] = pair
            yield left, right

    for answer, result in zip(expected, estimator.stream(camera()), strict=True):
        np.testing.assert_array_equal(answer, result.disparity)


def test_an_empty_stream_ends_at_once():
    assert list(DepthEstimator(TINY_MODEL).stream([])) == []


def test_no_more_pairs_are_in_flight_than_there_are_threads():
    drawn = 0

    def source():
        nonlocal drawn
        for pair in pairs(20):
            drawn += 1
            yield pair

    stream = DepthEstimator(TINY_MODEL, threads=2).stream(source())
    for number in range(1, 6):
        next(stream)
        time.sleep(0.05)  # a stream without bound would draw on
        assert drawn <= number + 2
    stream.close()
    assert streaming_threads() == []
    assert drawn < 20


def test_predict_between_two_frames_does_not_disturb_the_stream():
    estimator = DepthEstimator(TINY_MODEL)
    expected = [estimator.predict(*pair).disparity for pair in pairs()]
    for answer, result in zip(expected, estimator.stream(pairs()), strict=True):
        np.testing.assert_array_equal(result.disparity, answer)
        np.testing.assert_array_equal(estimator.predict(*pairs()[0]).disparity, expected[0])
        assert estimator.predict(*shifted_pair(64, 128, 4)).disparity.shape == (64, 128)


def failing_source():
    yield from pairs(2)
    raise ConnectionError("the camera is gone")


@pytest.mark.parametrize(
    ("source", "error", "good"),
    [
        (failing_source, ConnectionError, 2),
        (lambda: [*pairs(2), (np.zeros((96, 160, 3), np.float32),) * 2], errors.InvalidArgument, 2),
        (lambda: [*pairs(1), shifted_pair(64, 160, 4)], errors.InvalidArgument, 1),
        (lambda: [*pairs(3), pairs(1)[0][0]], errors.InvalidArgument, 3),
        (lambda: [*pairs(3), None], errors.InvalidArgument, 3),
    ],
    ids=["source", "type", "size", "no pair", "none"],
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


@pytest.mark.parametrize(
    ("item", "seen"), [((0,), "tuple of 1"), ([], "list of 0"), ((0, 0, 0, 0), "tuple of 4"), ("ab", "str")]
)
def test_an_item_that_is_no_pair_is_counted(item, seen):
    with pytest.raises(errors.InvalidArgument, match=rf"must yield \(left, right\), .* got {seen} \["):
        next(DepthEstimator(TINY_MODEL).stream([item]))


def test_what_is_no_source_is_refused_at_once():
    with pytest.raises(errors.InvalidArgument, match="source"):
        DepthEstimator(TINY_MODEL).stream(3)


class StalledCamera:
    """Gives some pairs and then none, without ending, until it is told to."""

    def __init__(self, count):
        self.items = iter(pairs(count))
        self.wakes = threading.Event()

    def __call__(self):
        item = next(self.items, None)
        if item is None:
            self.wakes.wait(60)
        return item


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_stream_whose_camera_has_stalled_can_be_left(threads):
    camera = StalledCamera(4)
    estimator = DepthEstimator(TINY_MODEL, threads=threads)
    started = time.monotonic()
    for number, _ in enumerate(estimator.stream(camera), 1):
        if number == 4:
            time.sleep(0.1)  # so that a lane waits in the camera
            break
    assert time.monotonic() - started < 5
    assert len(streaming_threads()) == 1
    assert list(estimator.stream(pairs(2)))[1].frame == 6
    camera.wakes.set()
    deadline = time.monotonic() + 5
    while streaming_threads() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert streaming_threads() == []


def test_one_interrupt_ends_a_program_whose_camera_has_stalled(tmp_path):
    program = tmp_path / "stalled.py"
    program.write_text(
        "import sys, queue, signal\n"
        # What a shell started in the background ignores interrupts, and so would its children.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"sys.path.insert(0, {str(ROOT)!r})\n"
        "from endosdk import DepthEstimator\n"
        "from tests.conftest import TINY_MODEL, shifted_pair\n"
        "frames = queue.Queue()\n"
        "frames.put(shifted_pair(96, 160, 4))\n"
        "for result in DepthEstimator(TINY_MODEL).stream(frames.get):\n"
        "    print('frame', flush=True)\n"
    )
    with subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as running:
        try:
            assert running.stdout.readline() == b"frame\n"
            time.sleep(0.2)
            running.send_signal(signal.SIGINT)
            assert running.wait(timeout=10) != 0
        finally:
            running.kill()


class Camera:
    """Pairs that wait for nobody, in memory that is used again."""

    def __init__(self, count, error=None):
        self.count, self.error = count, error
        self.all_given = threading.Event()

    def __iter__(self):
        buffers = tuple(np.empty((*SIZE, 3), np.uint8) for _ in range(2))
        for number in range(self.count):
            for buffer, view in zip(buffers, shifted_pair(*SIZE, 4 + number % 16), strict=True):
                buffer[:] = view
            yield buffers
        for buffer in buffers:
            buffer[:] = 0  # as a driver may that has no further frame
        self.all_given.set()
        if self.error is not None:
            raise self.error


@pytest.mark.parametrize("threads", [1, 2])
def test_a_slow_consumer_gets_the_newest_pair_and_the_number_of_those_that_were_dropped(threads):
    camera, estimator = Camera(40), DepthEstimator(TINY_MODEL, threads=threads)
    results = []
    for result in estimator.stream(camera, queue="newest"):
        results.append(result)
        assert camera.all_given.wait(60)
    assert len(results) <= threads + 2  # those that were on their way, the one that waited, and the first
    assert len(results) + sum(result.dropped for result in results) == 40
    wanted = estimator.predict(*shifted_pair(*SIZE, 4 + 39 % 16))
    np.testing.assert_array_equal(results[-1].disparity, wanted.disparity)
    assert [result.frame for result in results] == list(range(1, len(results) + 1))
    assert streaming_threads() == []


def test_every_pair_is_computed_unless_the_newest_is_asked_for():
    results = list(DepthEstimator(TINY_MODEL, threads=2).stream(Camera(12)))
    assert [result.dropped for result in results] == [0] * 12


def test_an_error_of_a_source_comes_after_its_newest_pair():
    camera, seen = Camera(20, ConnectionError("the camera is gone")), []
    with pytest.raises(ConnectionError):
        for result in DepthEstimator(TINY_MODEL, threads=1).stream(camera, queue="newest"):
            seen.append(result)
            assert camera.all_given.wait(60)
    assert len(seen) + sum(result.dropped for result in seen) == 20


def test_a_stream_of_newest_pairs_can_be_left_while_its_camera_stalls():
    camera = StalledCamera(3)
    started = time.monotonic()
    for _ in DepthEstimator(TINY_MODEL, threads=2).stream(camera, queue="newest"):
        time.sleep(0.05)
        break
    assert time.monotonic() - started < 5
    camera.wakes.set()
    deadline = time.monotonic() + 5
    while any(thread.name == "endosdk-source" for thread in threading.enumerate()) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not any(thread.name.startswith("endosdk-") for thread in threading.enumerate())


@pytest.mark.parametrize("queue", ["all", "", None, 3, True])
def test_another_queue_is_refused(queue):
    with pytest.raises(errors.InvalidArgument, match="queue: must be one of every, newest; got"):
        DepthEstimator(TINY_MODEL).stream(pairs(1), queue=queue)


def test_a_function_may_return_what_cannot_be_compared_with_none():
    with pytest.raises(errors.InvalidArgument, match="source"):
        list(DepthEstimator(TINY_MODEL).stream(lambda: np.stack(pairs(1)[0])))


def shaking_pairs(count=8):
    """One scene with noise that is new in every frame."""
    left, right = shifted_pair(*SIZE, 8)
    rng = np.random.default_rng(3)
    grain = rng.normal(0, 6, (count, 2, *left.shape))
    return [
        tuple(np.clip(view + grain[n, i], 0, 255).astype(np.uint8) for i, view in enumerate((left, right)))
        for n in range(count)
    ]


@pytest.mark.parametrize("threads", [1, 3])
def test_a_temporal_stream_flickers_less_and_is_the_same_on_any_number_of_threads(threads):
    estimator = DepthEstimator(TINY_MODEL, threads=threads)
    plain = np.array([result.disparity for result in estimator.stream(shaking_pairs())])
    steady = np.array([result.disparity for result in estimator.stream(shaking_pairs(), temporal=True)])
    np.testing.assert_array_equal(steady[0], plain[0])
    flicker = [np.median(np.abs(np.diff(found, axis=0))) for found in (plain, steady)]
    assert flicker[1] < 0.75 * flicker[0]
    alone = DepthEstimator(TINY_MODEL, threads=1).stream(shaking_pairs(), temporal=True)
    np.testing.assert_array_equal(steady, np.array([result.disparity for result in alone]))


def test_a_temporal_stream_goes_on_after_a_frame_that_failed():
    """The turn of the frame that failed passes to the next one."""
    estimator = DepthEstimator(TINY_MODEL, threads=2)
    with pytest.raises(errors.Cancelled):
        for _ in estimator.stream(shaking_pairs(40), temporal=True):
            estimator.cancel()
    assert len(list(estimator.stream(shaking_pairs(3), temporal=True))) == 3


SEEN = ((7, 96), (9, 80))  # number of a frame, as a source counts them, and its rows


def test_frames_of_another_size_are_refused_for_what_they_are():
    left, right = shifted_pair(*SIZE, 9)
    said = "left: must have the size of the stream, 160x96; got 160x80 in frame"
    with pytest.raises(errors.InvalidArgument, match=f"{said} 1 "):
        list(DepthEstimator(TINY_MODEL).stream([(left, right), (left[:80], right[:80])]))
    frames = [SimpleNamespace(left=left[:rows], right=right[:rows], monotonic_ns=None, number=n) for n, rows in SEEN]
    with pytest.raises(errors.InvalidArgument, match=f"{said} 9 "):
        list(DepthEstimator(TINY_MODEL).stream(frames))


def test_the_frames_of_a_source_are_rgb_whatever_the_estimator_is_given_else():
    left, right = (np.ascontiguousarray(view * (1.0, 0.7, 0.3)).astype(np.uint8) for view in shifted_pair(*SIZE, 9))
    frame = SimpleNamespace(left=left, right=right, monotonic_ns=None)
    wanted = DepthEstimator(TINY_MODEL).predict(left, right)
    (found,) = DepthEstimator(TINY_MODEL, channel_order="bgr").stream([frame])
    np.testing.assert_array_equal(found.disparity, wanted.disparity)
    swapped = DepthEstimator(TINY_MODEL, channel_order="bgr").predict(left, right)
    assert not np.array_equal(swapped.disparity, wanted.disparity)


def test_a_function_ends_with_the_iterator_that_it_draws_from():
    drawn = iter(pairs(3))
    assert len(list(DepthEstimator(TINY_MODEL).stream(lambda: next(drawn)))) == 3


@pytest.mark.parametrize("threads", [1, 2])
def test_a_closed_estimator_is_told_after_the_frames_in_flight(threads):
    for number in range(20):  # the reader is anywhere: at the source, at room for a pair, or at handing one over
        estimator = DepthEstimator(TINY_MODEL, threads=threads)
        stream = estimator.stream(pairs(1) * 20)
        assert next(stream).frame == 1
        time.sleep(0.001 * (number % 5))
        estimator.close()
        seen = [1]
        with pytest.raises(errors.InvalidArgument, match="estimator: must be open; got a closed one"):
            seen.extend(result.frame for result in stream)
        assert seen == list(range(1, len(seen) + 1))
    assert streaming_threads() == []


def test_a_closed_estimator_is_told_while_the_source_is_asked():
    camera = StalledCamera(1)
    estimator = DepthEstimator(TINY_MODEL)
    stream = estimator.stream(camera)
    next(stream)
    estimator.close()
    with pytest.raises(errors.InvalidArgument, match="estimator: must be open; got a closed one"):
        next(stream)
    camera.wakes.set()


def test_an_estimator_may_be_closed_when_the_source_is_exhausted():
    asked = threading.Event()

    def source():
        yield from pairs(2)
        asked.set()

    estimator = DepthEstimator(TINY_MODEL, threads=2)
    stream = estimator.stream(source())
    next(stream)
    assert asked.wait(60)
    deadline = time.monotonic() + 60
    while streaming_threads():  # until the reader is done
        assert time.monotonic() < deadline, "the reader runs on"
        time.sleep(0.01)
    estimator.close()
    assert [result.frame for result in stream] == [2]


def test_a_frame_that_waits_for_a_slower_one_before_it_is_late(monkeypatch):
    """Its own work took no time, but nobody could have it before."""
    white = np.full((*SIZE, 3), 255, np.uint8)
    run = BoundRun.run

    def slow_for_white(self):
        if all(view.min() == 255 for view in self._inputs.values()):
            time.sleep(0.8)
        run(self)

    monkeypatch.setattr(BoundRun, "run", slow_for_white)
    estimator = DepthEstimator(TINY_MODEL, threads=2, deadline_ms=400.0)
    slow, waited = estimator.stream(iter([(white, white), shifted_pair(*SIZE, 8)]))
    assert slow.late and waited.late
    taken_ms = waited.causes[Cause.LATE] * 400
    assert taken_ms > 500 and waited.timings.total_ms < 0.8 * taken_ms
