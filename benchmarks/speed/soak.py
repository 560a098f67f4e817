"""Frames by the hundred thousand beside busy processes: latency, late frames marked, answers the same, memory flat.

    python -m benchmarks.speed.soak --json benchmarks/results/speed/soak.json

The pairs that come with the package go round. Each answer must be, byte for byte, the one that its pair had first. A
run that was interrupted goes on from its latest checkpoint, beside the record, when the same command is given again.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.datasets.samples import sample_pairs
from endosdk.io.progress import progress
from endosdk.jobs.bench import burdened

WARM_UP = 200  # frames after each start that do not count
CHECKPOINT = 1000  # frames
SLACK_MS = 2.0  # what the caller's own clock adds to the library's where nothing takes the core from it


@dataclass
class Tally:
    """What was seen so far; times are of the caller's clock."""

    times_ms: list[float] = field(default_factory=list)
    late: list[bool] = field(default_factory=list)
    growth_mb: list[float] = field(default_factory=list)  # of each run, from its warm-up on
    marked_in_time: int = 0  # frames that were marked late and were not
    unmarked: int = (
        0  # frames that were late and not marked: the caller had to wait for a core after the library was done
    )

    def save(self, path: Path) -> None:
        whole = path.with_suffix(".new.npz")
        counts = (self.marked_in_time, self.unmarked)
        np.savez(whole, times=self.times_ms, late=self.late, growth=self.growth_mb, counts=counts)
        whole.replace(path)

    @classmethod
    def load(cls, path: Path) -> Tally:
        if not path.exists():
            return cls()
        with np.load(path) as kept:
            return cls(*(kept[name].tolist() for name in ("times", "late", "growth")), *kept["counts"].tolist())


def resources() -> dict[str, float]:
    """Memory, MB, open files and threads of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    folders = {name: len(list(Path(f"/proc/self/{name}").iterdir())) for name in ("fd", "task")}
    return {"memory_mb": pages * os.sysconf("SC_PAGE_SIZE") / 2**20, **folders}


def digest(result: Any) -> bytes:
    return hashlib.sha256(b"".join(map(np.ndarray.tobytes, (result.disparity, result.reasons)))).digest()


def soak(
    estimator: DepthEstimator, deadline_ms: float, frames: int, checkpoint: Path
) -> tuple[Tally, dict[str, float]]:
    """Run until so many frames were counted, over all runs; ends where an answer differs."""
    pairs = [(pair.left, pair.right) for pair in sample_pairs()]
    first = [digest(estimator.predict(*pair)) for pair in pairs]
    tally = Tally.load(checkpoint)
    done, result, before = len(tally.times_ms), None, resources()
    tally.growth_mb.append(0.0)
    for number in progress(range(-WARM_UP, frames - done), unit="frame"):
        if number == 0:
            before = resources()
        turn = number % len(pairs)
        started = time.perf_counter()
        result = estimator.predict(*pairs[turn], out=result)
        elapsed = 1e3 * (time.perf_counter() - started)
        if digest(result) != first[turn]:
            raise SystemExit(f"frame {number}: another answer than the first of its pair")
        if number < 0:
            continue
        tally.times_ms.append(elapsed)
        tally.late.append(result.late)
        tally.marked_in_time += int(result.late and elapsed <= deadline_ms)
        tally.unmarked += int(not result.late and elapsed > deadline_ms + SLACK_MS)
        if (number + 1) % CHECKPOINT == 0:
            tally.growth_mb[-1] = resources()["memory_mb"] - before["memory_mb"]
            tally.save(checkpoint)
    after = resources()
    tally.growth_mb[-1] = after["memory_mb"] - before["memory_mb"]
    return tally, {f"more_{name}": after[name] - before[name] for name in ("fd", "task")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--load", type=int, default=2, help="busy processes beside")
    parser.add_argument("--deadline-ms", type=float, default=50.0)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    checkpoint = args.json.with_suffix(".npz")
    estimator = DepthEstimator(args.model, threads=args.threads, spinning=False, deadline_ms=args.deadline_ms)
    with burdened(args.load):
        tally, more = soak(estimator, args.deadline_ms, args.frames, checkpoint)
    times = np.array(tally.times_ms)
    p50, p99 = np.percentile(times, (50, 99))
    record = {
        "frames": times.size,
        "runs": len(tally.growth_mb),
        "latency_ms": {"p50": round(p50, 2), "p99": round(p99, 2), "max": round(times.max(), 2)},
        "late": int(np.sum(tally.late)),
        "late_by_the_callers_clock": int(np.sum(times > args.deadline_ms)),
        "marked_in_time": tally.marked_in_time,
        "late_and_unmarked": tally.unmarked,
        "memory_growth_mb": [round(growth, 2) for growth in tally.growth_mb],
        **more,
    }
    command = f"python -m benchmarks.speed.soak --model {estimator.model.name} --threads {args.threads}"
    command += f" --load {args.load} --deadline-ms {args.deadline_ms:g} --frames {args.frames}"
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})
    checkpoint.unlink(missing_ok=True)
    marks = f"{record['late']} of {times.size} marked late, {tally.unmarked} late and unmarked"
    print(f"p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {times.max():.2f} ms; {marks}")


if __name__ == "__main__":
    main()
