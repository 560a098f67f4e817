"""Frame rate with network threads that sleep while they wait, and with threads that poll, beside other busy processes.

    python -m benchmarks.speed.spinning --json benchmarks/results/speed/spinning.json

Both ways compute the shipped pairs in turns, because the speed of a machine changes meanwhile. They must give the same
disparities before a time counts. It needs a machine without other work.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.datasets.samples import RawPair, sample_pairs
from endosdk.io.progress import progress
from endosdk.jobs.bench import burdened, time_frames

MODELS = ("fast", "fast-320", "accurate")
SIZE = (960, 720)
THREADS = 2
LOADS = (0, 1, 2)  # busy processes
TURNS, SETTLING = 12, 5
WAYS = {"sleeping": False, "polling": True}


def check_same(ways: dict[str, DepthEstimator], pairs: list[RawPair]) -> None:
    """End the run where the ways differ: the time of another answer compares nothing."""
    for pair in pairs:
        one, other = (each.predict(pair.left, pair.right).disparity for each in ways.values())
        if not np.array_equal(one, other, equal_nan=True):
            raise SystemExit(f"{' and '.join(ways)} give unlike maps")


def measured(model: str, pairs: list[RawPair], frames: int) -> dict[str, dict[str, dict[str, float]]]:
    """Frames a second and spread of a frame's time, by the number of busy processes and the way to wait."""
    rig = pairs[0].calibration  # all shipped pairs come from one rig
    ways = {
        name: DepthEstimator(model, calibration=rig, threads=THREADS, spinning=polls) for name, polls in WAYS.items()
    }
    check_same(ways, pairs)
    found = {}
    for load in LOADS:
        spent: dict[str, list[float]] = {name: [] for name in ways}
        with burdened(load):
            for turn in range(TURNS):
                for name in sorted(ways, reverse=turn % 2 == 1):  # neither is always the first
                    timed = time_frames(ways[name], pairs, SETTLING, frames)
                    spent[name] += [frame[0] for frame in timed]
        found[f"{load} busy processes"] = {name: summary(times) for name, times in spent.items()}
    return found


def summary(times: list[float]) -> dict[str, float]:
    p50, p99 = np.percentile(times, [50, 99])
    return {
        "fps": round(1e3 / float(np.mean(times)), 1),
        "p50_ms": round(float(p50), 1),
        "p99_ms": round(float(p99), 1),
    }


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=25, help="frames of a turn")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    pairs = [pair.resized(*SIZE) for pair in sample_pairs()]
    models = {name: measured(name, pairs, args.frames) for name in progress(MODELS, unit="model")}
    record = {"size": list(SIZE), "threads": THREADS, "frames": TURNS * args.frames, "models": models}
    hashes = {"model_sha256": {name: model_run(name).sha256 for name in MODELS}}
    write_record(
        args.json, record, command=f"python -m benchmarks.speed.spinning --frames {args.frames}", hashes=hashes
    )
    for name, loads in models.items():
        print(name, loads)


if __name__ == "__main__":
    main()
