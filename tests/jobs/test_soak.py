"""Frames by the thousand beside busy processes: every late one is marked, and memory does not grow.

``ENDOSDK_SOAK_FRAMES=100000`` makes it as long as a release wants it.
"""

import os
import time
from pathlib import Path

import numpy as np

from endosdk import DepthEstimator
from endosdk.jobs.bench import burdened
from tests.conftest import TINY_MODEL, shifted_pair

FRAMES = int(os.environ.get("ENDOSDK_SOAK_FRAMES", "3000"))
WARM_UP = 200


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def test_late_frames_are_marked_and_memory_stays_under_load():
    left, right = shifted_pair(64, 128, 7)
    usual = DepthEstimator(TINY_MODEL, threads=1)
    times = [usual.predict(left, right).timings.total_ms for _ in range(WARM_UP)]
    deadline = 1.5 * float(np.median(times))
    estimator = DepthEstimator(TINY_MODEL, threads=1, deadline_ms=deadline)
    result, seen, own, marked = None, [], [], []
    with burdened(2):
        for number in range(WARM_UP + FRAMES):
            if number == WARM_UP:
                before = resident_mb()
            started = time.perf_counter()
            result = estimator.predict(left, right, out=result)
            seen.append(1e3 * (time.perf_counter() - started))
            own.append(result.timings.total_ms)
            marked.append(result.late)
    elapsed, late = np.array(seen), np.array(marked)
    assert not late[elapsed <= deadline].any(), "the library's time lies within the caller's"
    # Not so the other way round: after the library has stopped its clock, the caller may have to wait for a core.
    assert late[np.array(own) > deadline].all(), "a frame whose own time is over the deadline is marked"
    assert late.any(), "without late frames nothing was tried"
    assert estimator.diagnostics()["late"] == late.sum()
    assert resident_mb() - before < 4.0
    p50, p99 = np.percentile(elapsed, (50, 99))
    print(f"p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {elapsed.max():.2f} ms, {late.sum()} of {late.size} late")
