"""The bench of priorities: policies are timed beside busy processes, and afterwards no thread is a real-time one."""

import os
import threading
import time
from pathlib import Path

import pytest

from benchmarks.speed import real_time_priority as bench
from endosdk.datasets.samples import sample_pairs
from tests.conftest import TINY_MODEL

PAIRS = [pair.resized(160, 120) for pair in sample_pairs()[:2]]


def test_both_policies_are_timed_beside_busy_processes(monkeypatch):
    monkeypatch.setattr(bench, "TURNS", 2)
    monkeypatch.setattr(bench, "BUSY", 1)
    own = threading.get_native_id()
    try:
        os.sched_setscheduler(own, os.SCHED_FIFO, os.sched_param(bench.PRIORITY))
        os.sched_setscheduler(own, os.SCHED_OTHER, os.sched_param(0))
    except PermissionError:
        pytest.skip("no right to real-time priority (CAP_SYS_NICE)")
    found = bench.measured(str(TINY_MODEL), PAIRS, 3)
    assert list(found) == ["SCHED_OTHER", "SCHED_FIFO"]
    assert all(0 < one["p50_ms"] <= one["p99_ms"] <= one["max_ms"] for one in found.values())
    tasks = [int(task.name) for task in Path("/proc/self/task").iterdir()]
    # Threads of other tests may have any other policy.
    assert os.SCHED_FIFO not in {os.sched_getscheduler(task) for task in tasks}


def test_frames_come_at_the_rate_of_a_camera():
    with bench.DepthEstimator(str(TINY_MODEL), threads=1) as estimator:
        begun = time.perf_counter()
        assert len(bench.timed(estimator, PAIRS, 5)) == 5
        assert time.perf_counter() - begun >= (bench.SETTLING + 4) / bench.RATE


def test_a_system_that_allows_no_priority_is_told(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(bench.os, "sched_setscheduler", refuse)
    with pytest.raises(SystemExit, match="SCHED_FIFO needs CAP_SYS_NICE"):
        bench.schedule([1], "SCHED_FIFO")
