"""An estimator at work: deadlines, cancel, self test, reports and closing, as the C library has them."""

import logging
import re
import subprocess
import sys
import threading

import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration, errors
from endosdk.runtime.session import BoundRun
from tests.c_library.test_errors import double_disparity, edited_model
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

PAIR = shifted_pair(96, 160, 9)
LARGE = shifted_pair(960, 1280, 9)


def test_late_frames_are_marked_counted_and_logged(caplog):
    with caplog.at_level(logging.WARNING, "endosdk.frames"):
        estimator = DepthEstimator(TINY_MODEL, deadline_ms=1e-6)
        assert estimator.predict(*PAIR).late
        assert [result.late for result in estimator.stream([PAIR, PAIR])] == [True, True]
    assert estimator.diagnostics()["late"] == 3
    assert sum("was late" in line for line in caplog.messages) == 3
    assert not DepthEstimator(TINY_MODEL, deadline_ms=60_000.0).predict(*PAIR).late
    assert not DepthEstimator(TINY_MODEL).predict(*PAIR).late


def test_diagnostics_tell_the_spread_of_latencies():
    estimator = DepthEstimator(TINY_MODEL, threads=1)
    times = sorted(estimator.predict(*PAIR).timings.total_ms for _ in range(20))
    latency = estimator.diagnostics()["latency_ms"]
    assert latency["max"] >= times[-1]
    assert 0 < latency["p50"] <= latency["p95"] <= latency["p99"] <= latency["max"]
    assert latency["p50"] == pytest.approx(np.median(times), rel=0.25)  # it is kept in steps


def test_logs_hold_nothing_of_the_pictures(caplog, capfd):
    """Two pictures that share no pixel value leave the same lines, but for times and measures."""
    left = PAIR[0] // 2
    found = []
    for view in (left, 255 - left):
        caplog.clear()
        with caplog.at_level(logging.DEBUG, "endosdk"):
            DepthEstimator(TINY_MODEL, deadline_ms=1e-6).predict(view, view)
        assert len(caplog.records) >= 2
        assert all(len(line) < 300 for line in caplog.messages)
        assert all(isinstance(part, str | int | float) for record in caplog.records for part in record.args or ())
        found.append([re.sub(r"[0-9]+", "", line) for line in caplog.messages])
    assert found[0] == found[1]
    assert capfd.readouterr() == ("", "")


def test_pairs_of_two_scenes_are_counted_and_logged(caplog):
    estimator = DepthEstimator(TINY_MODEL)
    with caplog.at_level(logging.WARNING, "endosdk.frames"):
        estimator.predict(PAIR[0], PAIR[0])
    assert "one camera is connected to both inputs" in caplog.text
    assert estimator.diagnostics()["causes"]["SAME_VIEW_TWICE"] == 1


def test_lines_about_frames_are_silent_unless_logging_is_set_up():
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from endosdk import DepthEstimator\n"
        "from tests.conftest import TINY_MODEL, shifted_pair\n"
        "DepthEstimator(TINY_MODEL, deadline_ms=1e-6).predict(*shifted_pair(96, 160, 9))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr == ""


@pytest.mark.parametrize("way", ["predict", "stream"])
def test_a_frame_in_work_can_be_cancelled(way):
    estimator = DepthEstimator(TINY_MODEL)
    finished = threading.Event()

    def cancel():
        while not finished.is_set():
            estimator.cancel()

    estimator.cancel()  # nothing runs: nothing happens
    canceller = threading.Thread(target=cancel)
    canceller.start()
    try:
        with pytest.raises(errors.Cancelled, match="CANCELLED"):
            if way == "predict":
                estimator.predict(*LARGE)
            else:
                list(estimator.stream([LARGE] * 20))
    finally:
        finished.set()
        canceller.join()
    assert np.median(estimator.predict(*PAIR).disparity) == pytest.approx(9, abs=0.5)


def test_self_test_passes_and_leaves_no_trace():
    estimator = DepthEstimator(TINY_MODEL)
    before = estimator.predict(*PAIR)
    estimator.self_test()
    after = estimator.predict(*PAIR)
    np.testing.assert_array_equal(before.disparity, after.disparity)
    assert after.frame == 2


def test_a_model_that_finds_something_else_fails_the_self_test():
    with DepthEstimator(edited_model(double_disparity)) as estimator:
        with pytest.raises(errors.SelfTestFailed, match="self test: disparity: a plane must be right to a pixel"):
            estimator.self_test()
        assert estimator.diagnostics()["frames"] == 0


def test_the_nearest_depth_is_known_before_the_first_frame():
    rig = StereoCalibration.rectified(210.0, 4.5, (240, 120), doffs=2.0)
    assert DepthEstimator(TINY_MODEL).nearest_depth_mm is None
    estimator = DepthEstimator(TINY_MODEL, calibration=rig, network_size=(120, 60))
    assert estimator.nearest_depth_mm == pytest.approx(210.0 * 4.5 / ((31 - 0.5) * 2), rel=1e-6)
    assert estimator.diagnostics()["nearest_depth_mm"] == pytest.approx(estimator.nearest_depth_mm)


NEAREST = "nearest depth this model sees on this rig: 31 mm"


@pytest.mark.parametrize(
    ("depth_range_mm", "level", "more"),
    [
        ((0.0, np.inf), "WARNING", "; instruments come nearer, and get no depth there"),
        ((20.5, np.inf), "WARNING", "; depths from 20.5 mm on are asked for"),
        ((20.0, 25.0), "WARNING", "; no pixel has an answer up to the 25 mm asked for"),
        ((31.0, 200.0), "INFO", ""),
    ],
)
def test_the_nearest_depth_of_a_rig_is_told_at_load(caplog, depth_range_mm, level, more):
    rig = StereoCalibration.rectified(210.0, 9.0, (240, 120))
    with caplog.at_level(logging.INFO, "endosdk.rigs"):
        estimator = DepthEstimator(TINY_MODEL, calibration=rig, network_size=(120, 60), depth_range_mm=depth_range_mm)
    assert estimator.nearest_depth_mm == pytest.approx(210.0 * 9.0 / (2 * 30.5))
    assert [(line.levelname, line.message) for line in caplog.records] == [(level, NEAREST + more)]


def test_a_rig_whose_instruments_are_in_sight_is_no_warning(caplog):
    with caplog.at_level(logging.INFO, "endosdk.rigs"):
        DepthEstimator(TINY_MODEL, calibration=StereoCalibration.rectified(210.0, 4.0, (240, 120)))
    line_of_the_log = "nearest depth this model sees on this rig: 28 mm"
    assert [(line.levelname, line.message) for line in caplog.records] == [("INFO", line_of_the_log)]


def test_a_rig_of_absurd_size_gets_a_line_that_has_an_end(caplog):
    with caplog.at_level(logging.INFO, "endosdk.rigs"):
        DepthEstimator(TINY_MODEL, calibration=StereoCalibration.rectified(1e150, 210.0, (240, 120)))
    assert all(len(line.message) < 160 for line in caplog.records)
    assert caplog.records[0].message.endswith("e+150 mm; instruments come nearer, and get no depth there")


def test_the_largest_disparity_is_that_of_the_frame():
    estimator = DepthEstimator(TINY_MODEL, network_size=(120, 60))
    assert estimator.largest_disparity(480, 240) == pytest.approx(4 * 30.5)
    # The network sees the right view of such a rig moved.
    rig = StereoCalibration.rectified(200.0, 5.0, (480, 240), doffs=20.0)
    moved = DepthEstimator(TINY_MODEL, network_size=(120, 60), calibration=rig)
    assert moved.largest_disparity(480, 240) == pytest.approx(4 * 30.5 - 20)
    assert moved.nearest_depth_mm == pytest.approx(1000 / (4 * 30.5))


@pytest.mark.parametrize("size", [(0, 96), (2**31 - 1, 2**31 - 1), (2**40, 96), (160.5, 96), ("160", 96)])
def test_a_size_that_no_frame_has_is_refused(size):
    estimator = DepthEstimator(TINY_MODEL)
    for call in (estimator.prepare, estimator.largest_disparity):
        with pytest.raises(errors.InvalidArgument, match="size: must be"):
            call(*size)
    estimator.prepare(160, 96)


def test_a_frame_so_narrow_that_the_network_has_no_picture_of_it_is_refused():
    with pytest.raises(errors.InvalidArgument, match=r"size: must be wider: .* 32767 px; got 4x480"):
        DepthEstimator("fast").prepare(4, 480)


def test_a_closed_estimator_says_so():
    with DepthEstimator(TINY_MODEL) as estimator:
        kept = estimator.predict(*PAIR)
    assert kept.disparity.shape == (96, 160)
    for call in (
        lambda: estimator.predict(*PAIR),
        lambda: list(estimator.stream([PAIR])),
        estimator.self_test,
        lambda: estimator.prepare(160, 96),
    ):
        with pytest.raises(errors.InvalidArgument, match="estimator: must be open"):
            call()
    assert estimator.diagnostics()["frames"] == 1
    estimator.close()


@pytest.fixture
def held_frame(monkeypatch):
    """An estimator with a frame in work, the list for its result, its thread, and the event that lets it go on."""
    begun, go_on = threading.Event(), threading.Event()
    run = BoundRun.run

    def held(self):
        begun.set()
        go_on.wait(60)
        run(self)

    monkeypatch.setattr(BoundRun, "run", held)
    estimator, found = DepthEstimator(TINY_MODEL), []
    caller = threading.Thread(target=lambda: found.append(estimator.predict(*PAIR)))
    caller.start()
    try:
        assert begun.wait(60)
        yield estimator, found, caller, go_on
    finally:
        go_on.set()
        caller.join()


def test_closing_waits_for_the_call_that_runs(held_frame):
    estimator, found, caller, go_on = held_frame
    closer = threading.Thread(target=estimator.close)
    closer.start()
    closer.join(0.3)
    assert closer.is_alive() and caller.is_alive()
    go_on.set()
    for thread in (closer, caller):
        thread.join(60)
        assert not thread.is_alive()
    assert found[0].frame == 1
    with pytest.raises(errors.InvalidArgument, match="estimator: must be open"):
        estimator.predict(*PAIR)


def test_reports_do_not_wait_for_frames(held_frame):
    estimator, found, caller, go_on = held_frame
    report = estimator.diagnostics()
    assert caller.is_alive() and not found and not go_on.is_set()
    assert (report["frames"], report["failed"]) == (0, 0)
    go_on.set()
    caller.join(60)
    report = estimator.diagnostics()
    assert found[0].frame == 1 and (report["frames"], report["failed"]) == (1, 0)
