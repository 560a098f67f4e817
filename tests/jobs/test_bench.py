import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from endosdk import errors
from endosdk.commands.cli import main
from endosdk.datasets.samples import sample_pairs
from endosdk.evaluation.metrics import end_point_error
from endosdk.evaluation.sgbm import SgbmBaseline
from endosdk.jobs import bench
from endosdk.jobs.bench import TURNS, BenchSettings, burdened, run_benchmark, time_frames
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.models import read_model
from endosdk.runtime.rectify import rectified
from endosdk.runtime.result import Timings
from endosdk.runtime.session import StereoSession
from tests.conftest import TINY_MODEL

SMALL = ["--size", "480x360", "--network-size", "320x240", "--threads", "1", "--frames", "27", "--warmup", "1"]


def test_shipped_pairs_are_raw_and_have_truth():
    pairs = sample_pairs()
    assert pairs
    for pair in pairs:
        assert pair.left.shape == pair.right.shape == (720, 960, 3)
        assert not pair.calibration.is_rectified
        assert np.isfinite(pair.disparity).mean() > 0.9
        assert 2 < np.nanmean(pair.disparity) < 69.5


SIZES = [(480, 360), (1280, 720), (1920, 1080), (640, 512), (360, 480)]


@pytest.mark.parametrize("size", SIZES)
def test_the_truth_of_a_resized_pair_is_that_of_the_same_points(size):
    """Each pixel, taken through the raw left camera into the whole pair's rectified view, has the depth known there."""
    import cv2

    whole, pair = sample_pairs()[0], sample_pairs()[0].resized(*size)
    assert pair.left.shape == pair.right.shape == (*size[::-1], 3)
    assert np.isfinite(pair.disparity).mean() > 0.98
    rows, columns = np.indices(pair.disparity.shape)[:, ::7, ::7].reshape(2, -1)
    old, new = whole.calibration.rectification(), pair.calibration.rectification()
    rays = np.stack([(columns - new.cx) / new.P1[0, 0], (rows - new.cy) / new.P1[1, 1], np.ones(len(rows))])
    camera = whole.calibration.left_matrix, whole.calibration.left_distortion
    raw, _ = cv2.projectPoints((new.R1.T @ rays).T.copy(), np.zeros(3), np.zeros(3), *camera)
    x, y = np.rint(cv2.undistortPoints(raw, *camera, R=old.R1, P=old.P1)[:, 0].T).astype(int)
    x, y = x.clip(0, old.width - 1), y.clip(0, old.height - 1)
    known = old.focal_px * old.baseline_mm / (whole.disparity[y, x] + old.doffs)
    expected = new.focal_px * new.baseline_mm / known - new.doffs
    errors = np.abs(pair.disparity[rows, columns] - expected)
    # Where a pixel falls between two, either may be the nearest; everywhere else it is the same point.
    assert np.nanmedian(errors) < 1e-4
    assert np.nanmean(errors) < 0.05


@pytest.mark.parametrize("size", SIZES)
def test_the_pictures_of_a_resized_pair_match_where_its_truth_says(size):
    pair = sample_pairs()[0].resized(*size)
    left, right = (view.transpose(2, 0, 1) for view in rectified(pair.left, pair.right, pair.calibration))
    rows, columns = np.indices(pair.disparity.shape)
    shifts = np.arange(-3, 4)
    costs = []
    for shift in shifts:
        place = columns - pair.disparity - shift
        there = np.isfinite(place) & (place >= 0) & (place <= size[0] - 1)
        match = right[:, rows[there], np.rint(place[there]).astype(int)]
        costs.append(np.abs(left[:, there].astype(float) - match).mean())
    assert shifts[np.argmin(costs)] == 0


def test_a_model_is_as_good_on_wide_frames():
    pair = sample_pairs()[0].resized(1280, 720)
    found = DepthEstimator("fast-fp32", calibration=pair.calibration, threads=1).predict(pair.left, pair.right)
    assert end_point_error(found.disparity, pair.disparity) < 0.6


@pytest.mark.parametrize("size", ["1x1", "1000x100", "20000x20000"])
def test_sizes_that_no_camera_has_are_refused(size, capsys):
    assert main(["bench", "--size", size]) == 2
    rule = "size: must be 64 to 8192 px a side, one side at most 4 times the other"
    assert f"{rule}; got {size}" in capsys.readouterr().err


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The record of one real benchmark, and how often it asked the rival for a map."""
    file, asked = tmp_path_factory.mktemp("bench") / "bench.json", []
    compute = SgbmBaseline.compute
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SgbmBaseline, "compute", lambda *views: asked.append(1) or compute(*views))
        assert main(["bench", "--model", "fast-fp32", *SMALL, "--against", "sgbm", "--out", str(file)]) == 0
    return json.loads(file.read_text()), len(asked)


def test_record_has_every_key(measured):
    record, _ = measured
    assert record["window"] == [0, 0, 960, 720]
    assert record["fps"] > 0
    assert set(record["latency_ms"]) == {"p50", "p95", "p99", "max"}
    assert set(record["stages_ms"]) == {"rectify", "session", "postprocess"}
    assert record["stream_fps"] > 0
    assert 0 < record["startup_s"] < 60
    assert record["peak_rss_mb"] > 10
    assert 0 < record["epe_px"] < 3
    assert record["against"]["sgbm"]["fps"] > 0
    assert record["against"]["sgbm"]["epe_px"] > 0
    assert {"cpu", "instructions", "threads", "versions", "commit"} <= set(record["machine"])


def test_every_frame_is_timed_whatever_their_number(measured):
    record, asked = measured
    assert record["frames"] == 27  # no multiple of the turns
    assert asked == len(sample_pairs()) + 27 + TURNS  # the check, the frames, one to warm up for each turn


WARMUP = 2


class Machine:
    """Its clock moves only while something runs. The first runs of what has not run just before take a second each."""

    def __init__(self):
        self.now, self.running, self.times = 0.0, None, 0

    def perf_counter(self):
        return self.now

    def run(self, what, *milliseconds):
        """Take the next of these times, one after the other and again from the first, once it is warm."""
        self.times = self.times + 1 if what == self.running else 0
        self.running = what
        warm = self.times - WARMUP
        self.now += 1.0 if warm < 0 else milliseconds[warm % len(milliseconds)] / 1e3


class RightModel:
    """What the benchmark takes for an estimator: one frame of ten takes longer, and a stream gives one every 4 ms."""

    def __init__(self, machine, truth):
        self.model = StereoSession(read_model(TINY_MODEL), threads=1).info
        self.machine, self.truth, self.asked = machine, truth, None

    def __call__(self, model, **asked):
        self.asked = asked
        return self

    def predict(self, left, right, out=None):
        self.machine.run("predict", *[10] * 9, 60)
        return SimpleNamespace(disparity=self.truth, timings=Timings(1.0, 2.0, 3.0))

    def stream(self, source, reuse):
        for _ in source:
            self.machine.run("stream", 4)
            yield None

    def diagnostics(self):
        return dict.fromkeys(("network_width", "network_height", "provider", "provider_options", "kernels"), "any")


@pytest.fixture
def one_opencv_thread():
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(before)


def test_rates_are_of_the_frames_after_the_warm_up_on_as_many_threads_as_asked(monkeypatch, one_opencv_thread):
    import cv2

    pair = sample_pairs()[0]
    truth = pair.resized(480, 360).disparity
    machine = Machine()
    model = RightModel(machine, truth)
    opencv_threads, programs = [], []

    def match(matcher, left, right):
        machine.run("sgbm", *[5] * 9, 35)
        opencv_threads.append(cv2.getNumThreads())
        return truth

    def start(command, **how):
        programs.append(command[2])
        return SimpleNamespace(returncode=0, stdout=("[3, 100]", "[1, 300]", "[2, null]")[len(programs) - 1])

    monkeypatch.setattr(bench, "time", machine)
    monkeypatch.setattr(bench, "DepthEstimator", model)
    monkeypatch.setattr(bench, "sample_pairs", lambda: [pair])
    monkeypatch.setattr(bench, "subprocess", SimpleNamespace(run=start))
    monkeypatch.setattr(SgbmBaseline, "compute", match)
    record = run_benchmark(BenchSettings("right", (480, 360), (320, 240), 2, 50, WARMUP, "cpu", "sgbm", {"a": "b"}))

    assert record["fps"] == pytest.approx(1000 / 15)
    assert record["latency_ms"] == pytest.approx({"p50": 10, "p95": 60, "p99": 60, "max": 60})
    assert record["stages_ms"] == {"rectify": 1, "session": 2, "postprocess": 3}
    assert record["stream_fps"] == pytest.approx(1000 / 4)
    rival = record["against"]["sgbm"]
    assert rival["fps"] == pytest.approx(1000 / 8)
    assert rival["latency_ms"] == pytest.approx({"p50": 5, "p95": 35, "p99": 35, "max": 35})
    assert (record["startup_s"], record["peak_rss_mb"]) == (2, 300)  # the median of three starts, the most memory

    expected = {"provider": "cpu", "provider_options": {"a": "b"}, "threads": 2, "network_size": (320, 240)}
    assert {key: model.asked[key] for key in expected} == expected
    assert all("threads=2, network_size=(320, 240), provider_options={'a': 'b'}" in program for program in programs)
    timed = TURNS * (WARMUP + 10)
    assert opencv_threads[-timed:] == [2] * timed and cv2.getNumThreads() == 1


def test_a_frame_has_its_own_time_and_stages(monkeypatch):
    machine = Machine()
    answers = []

    class Slower:
        def predict(self, left, right, out):
            assert out is (answers[-1] if answers else None)  # maps are made once, not for each frame
            number = len(answers) + 1
            machine.now += number / 1e3
            answers.append(SimpleNamespace(timings=Timings(number + 0.1, number + 0.2, number + 0.3)))
            return answers[-1]

    monkeypatch.setattr(bench, "time", machine)
    pairs = [SimpleNamespace(left=None, right=None)] * 2
    found = np.array(time_frames(Slower(), pairs, 2, 3))
    np.testing.assert_allclose(found, [[n, n + 0.1, n + 0.2, n + 0.3] for n in (3, 4, 5)])


@pytest.mark.parametrize("size, most", [((64, 64), 16), ((480, 360), 32), ((1920, 1080), 112)])
def test_the_rival_searches_the_disparities_that_there_are(size, most):
    pairs = [pair.resized(*size) for pair in sample_pairs()]
    truth = max(np.nanmax(pair.disparity) for pair in pairs)
    rival = bench._Sgbm(pairs, BenchSettings("fast-fp32", size, None, 1, 25, 1, "cpu", "sgbm"))
    rival.time(0, 1)
    assert most - 16 <= truth < most == rival.record()["max_disparity"]


def test_a_rival_that_gives_nonsense_is_not_timed(monkeypatch):
    monkeypatch.setattr(SgbmBaseline, "compute", lambda self, left, right: np.ones(left.shape[:2], np.float32))
    settings = BenchSettings("fast-fp32", (480, 360), (320, 240), 1, 25, 1, "cpu", "sgbm")
    with pytest.raises(errors.InferenceFailed, match=r"against: must be within .* before it is timed"):
        run_benchmark(settings)


def test_a_model_that_gives_nonsense_is_not_timed():
    # Seen 1440 px wide, most of the tissue lies beyond the 32 px that this model reaches.
    settings = BenchSettings(str(TINY_MODEL), (960, 720), (1440, 1080), 1, 25, 1, "cpu", None)
    with pytest.raises(errors.InferenceFailed, match="before it is timed"):
        run_benchmark(settings)


@pytest.mark.parametrize("frames, threads, least", [(0, 1, 25), (5, 2, 50), (49, 2, 50)])
def test_too_few_frames_for_a_rate_are_refused(frames, threads, least):
    rule = f"frames: must be at least {least} for {threads} threads; got {frames}"
    with pytest.raises(errors.InvalidArgument, match=rule):
        run_benchmark(BenchSettings(str(TINY_MODEL), (480, 360), None, threads, frames, 1, "cpu", None))


def test_the_rate_of_a_stream_is_no_better_than_its_threads(measured):
    record, _ = measured
    # One frame in flight: no more than what is copied and checked around it can be hidden. The machine may be busy.
    assert record["stream_fps"] < 3 * 1000 / record["latency_ms"]["p50"]


def test_a_load_ends_with_the_timing_of_the_frames():
    def children() -> list[str]:
        return (Path("/proc/self/task") / str(os.getpid()) / "children").read_text().split()

    before = children()
    with burdened(2):
        assert len(children()) == len(before) + 2
    assert children() == before
    with pytest.raises(errors.InvalidArgument, match="load: must be at least 0"), burdened(-1):
        pass


def test_a_load_ends_with_a_process_that_is_killed():
    program = (
        "import time\nfrom endosdk.jobs.bench import burdened\nwith burdened(1): print(flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        (child,) = (Path("/proc") / str(parent.pid) / "task" / str(parent.pid) / "children").read_text().split()
        parent.kill()
    deadline = time.monotonic() + 30
    while runs(child):
        assert time.monotonic() < deadline, "the busy process runs on"
        time.sleep(0.05)


def runs(process: str) -> bool:
    """Whether it has not ended; one that nobody waits for stays as a zombie."""
    try:
        return (Path("/proc") / process / "stat").read_text().split()[2] != "Z"
    except OSError:  # gone, or going
        return False
