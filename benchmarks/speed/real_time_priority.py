"""Time of a frame with the priority of every process and with SCHED_FIFO, beside busy processes.

    python -m benchmarks.speed.real_time_priority --json benchmarks/results/speed/real_time_priority.json

Frames come at the rate of a camera. In turns, the threads of one estimator and the one that calls it have the usual
priority and a real-time one; the busy processes keep theirs. It needs CAP_SYS_NICE.
"""

from __future__ import annotations

import argparse
import os
import threading
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.datasets.samples import RawPair, sample_pairs
from endosdk.jobs.bench import burdened

MODEL = "fast"
SIZE = (960, 720)
THREADS = 2
RATE = 25  # frames a second: back to back, real-time threads would use all that the system leaves them
BUSY = 2  # processes
TURNS, SETTLING = 12, 5
PRIORITY = 50
POLICIES = {"SCHED_OTHER": (os.SCHED_OTHER, 0), "SCHED_FIFO": (os.SCHED_FIFO, PRIORITY)}


def schedule(threads: Iterable[int], policy: str) -> None:
    """Give threads a policy. Ends the run where the system does not allow it."""
    kind, priority = POLICIES[policy]
    try:
        for thread in threads:
            os.sched_setscheduler(thread, kind, os.sched_param(priority))
    except PermissionError:
        raise SystemExit(f"{policy} needs CAP_SYS_NICE") from None


def timed(estimator: DepthEstimator, pairs: list[RawPair], frames: int) -> list[float]:
    """Milliseconds of every frame after the first ones. A frame begins when it is due, or when the one before ends."""
    spent, result = [], None
    due = time.perf_counter()
    for number in range(SETTLING + frames):
        pair = pairs[number % len(pairs)]
        time.sleep(max(0.0, due - time.perf_counter()))
        begun = time.perf_counter()
        result = estimator.predict(pair.left, pair.right, out=result)
        spent.append(1e3 * (time.perf_counter() - begun))
        due = max(due, begun) + 1 / RATE
    return spent[SETTLING:]


def measured(model: str, pairs: list[RawPair], frames: int) -> dict[str, dict[str, float]]:
    """Spread of a frame's time, by the policy."""
    threads = [threading.get_native_id()]

    def started(number: int, _: str) -> None:
        threads.append(number)

    rig = pairs[0].calibration  # all shipped pairs come from one rig
    spent: dict[str, list[float]] = {policy: [] for policy in POLICIES}
    with DepthEstimator(model, calibration=rig, threads=THREADS, thread_started=started) as estimator, burdened(BUSY):
        estimator.prepare(*pairs[0].left.shape[1::-1])
        for turn in range(TURNS):
            for policy in sorted(POLICIES, reverse=turn % 2 == 1):  # neither is always the first
                schedule(threads, policy)
                try:
                    spent[policy] += timed(estimator, pairs, frames)
                finally:
                    schedule(threads, "SCHED_OTHER")
    return {policy: summary(times) for policy, times in spent.items()}


def summary(times: list[float]) -> dict[str, float]:
    """Median, 99th percentile and largest of times, ms."""
    p50, p99, largest = np.percentile(times, [50, 99, 100])
    return {"p50_ms": round(float(p50), 1), "p99_ms": round(float(p99), 1), "max_ms": round(float(largest), 1)}


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=50, help="frames of a turn")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    pairs = [pair.resized(*SIZE) for pair in sample_pairs()]
    found = {
        "size": list(SIZE),
        "threads": THREADS,
        "rate": RATE,
        "busy": BUSY,
        "frames": TURNS * args.frames,
        "priority": PRIORITY,
        "load_average_before": round(os.getloadavg()[0], 2),
        "policies": measured(MODEL, pairs, args.frames),
    }
    command = f"python -m benchmarks.speed.real_time_priority --frames {args.frames}"
    write_record(args.json, found, command=command, hashes={"model_sha256": {MODEL: model_run(MODEL).sha256}})
    print(found)


if __name__ == "__main__":
    main()
