import json

import numpy as np
import pytest

from endosdk import errors
from endosdk.baseline import SgbmBaseline
from endosdk.bench import TURNS, BenchSettings, run_benchmark
from endosdk.cli import main
from endosdk.samples import sample_pairs
from tests.conftest import TINY_MODEL

SMALL = ["--size", "480x360", "--network-size", "320x240", "--threads", "1", "--frames", "4", "--warmup", "1"]


def test_shipped_pairs_are_raw_and_have_truth():
    pairs = sample_pairs()
    assert pairs
    for pair in pairs:
        assert pair.left.shape == pair.right.shape == (720, 960, 3)
        assert not pair.calibration.is_rectified
        assert np.isfinite(pair.disparity).mean() > 0.9
        assert 2 < np.nanmean(pair.disparity) < 69.5


def test_resized_pair_keeps_its_geometry():
    pair = sample_pairs()[0]
    half = pair.resized(480, 360)
    assert np.nanmedian(half.disparity) == pytest.approx(np.nanmedian(pair.disparity) / 2, rel=0.02)
    assert half.calibration.width == 480
    full, small = pair.calibration.rectification(), half.calibration.rectification()
    assert small.focal_px == pytest.approx(full.focal_px / 2, rel=0.01)


def test_record_has_every_key(tmp_path):
    file = tmp_path / "bench.json"
    assert main(["bench", "--model", "wang2020", *SMALL, "--against", "sgbm", "--json", str(file)]) == 0
    record = json.loads(file.read_text())
    assert record["fps"] > 0
    assert set(record["latency_ms"]) == {"p50", "p95", "p99", "max"}
    assert set(record["stages_ms"]) == {"rectify", "session", "postprocess"}
    assert record["stream_fps"] > 0
    assert 0 < record["startup_s"] < 60
    assert record["peak_rss_mb"] > 10
    assert 0 < record["epe_px"] < 3
    assert record["against"]["sgbm"]["fps"] > 0
    assert record["against"]["sgbm"]["epe_px"] > 0
    assert {"cpu", "threads", "versions", "commit"} <= set(record["machine"])


def test_every_frame_is_timed_whatever_their_number(monkeypatch):
    timed = []
    rival = SgbmBaseline.compute
    monkeypatch.setattr(SgbmBaseline, "compute", lambda *views: timed.append(1) or rival(*views))
    settings = BenchSettings("wang2020", (480, 360), (320, 240), 1, 7, 1, "cpu", "sgbm")
    record = run_benchmark(settings)
    assert record["frames"] == 7
    assert len(timed) == len(sample_pairs()) + 7 + TURNS  # the check, the frames, one to warm up for each turn


def test_a_model_that_gives_nonsense_is_not_timed():
    # Block matching without training loses its way on glare and smooth tissue, and reaches 32 px alone.
    settings = BenchSettings(str(TINY_MODEL), (960, 720), None, 1, 2, 1, "cpu", None)
    with pytest.raises(errors.InferenceFailed, match="before it is timed"):
        run_benchmark(settings)


def test_no_frame_is_refused():
    with pytest.raises(errors.InvalidArgument, match="frames"):
        run_benchmark(BenchSettings(str(TINY_MODEL), (480, 360), None, 1, 0, 1, "cpu", None))
