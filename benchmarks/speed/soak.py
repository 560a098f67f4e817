"""Frames by the hundred thousand beside busy processes: latency, late frames marked, answers the same, memory flat.

    python -m benchmarks.speed.soak --json benchmarks/results/speed/soak.json
    python -m benchmarks.speed.soak --beside "COMMAND" --json benchmarks/results/speed/soak.json

The pairs that come with the package go round. Each answer must be, byte for byte, the one that its pair had first. A
run that was interrupted goes on from its latest checkpoint, beside the record, when the same command is given again;
one of another command, model, commit or installed version is refused.
With --beside, the processors are kept busy by a program of your own, which must run as long as the soak.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.datasets.samples import sample_pairs
from endosdk.io.progress import progress
from endosdk.jobs.bench import burdened
from endosdk.jobs.machine import commit, versions

WARM_UP = 200  # frames after each start that do not count
CHECKPOINT = 1000  # frames
SLACK_MS = 2.0  # what the caller's own clock adds to the library's where nothing takes the core from it


@dataclass
class Tally:
    """What was seen so far; times are of the caller's clock."""

    made_by: dict[str, str]  # command, model, commit and versions, which all runs share
    times_ms: list[float] = field(default_factory=list)
    late: list[bool] = field(default_factory=list)
    growth_mb: list[float] = field(default_factory=list)  # of each run, from its warm-up on
    beside: list[str] = field(default_factory=list)  # what kept the cores busy in each run
    marked_in_time: int = 0  # frames that were marked late and were not
    # Frames that were late and not marked: the caller had to wait for a core after the library was done.
    unmarked: int = 0

    def save(self, path: Path) -> None:
        whole = path.with_suffix(".new.npz")
        counts = (self.marked_in_time, self.unmarked)
        lists = {"times": self.times_ms, "late": self.late, "growth": self.growth_mb, "beside": self.beside}
        arrays = {name: np.asarray(values) for name, values in lists.items()}
        np.savez(whole, **arrays, counts=counts, made_by=json.dumps(self.made_by))
        whole.replace(path)

    @classmethod
    def load(cls, path: Path, made_by: dict[str, str]) -> Tally:
        """Go on with what is in the file. Ends where that was made by something else than this run is."""
        if not path.exists():
            return cls(made_by)
        with np.load(path) as kept:
            before = json.loads(str(kept["made_by"])) if "made_by" in kept else {}
            for name in {**made_by, **before}:
                if before.get(name) != made_by.get(name):
                    said = f"{name} must be {before.get(name)}, as in the checkpoint; got {made_by.get(name)}"
                    raise SystemExit(f"{said}. Remove {path} to begin anew")
            lists = (kept[name].tolist() for name in ("times", "late", "growth", "beside"))
            return cls(made_by, *lists, *kept["counts"].tolist())


def resources() -> dict[str, float]:
    """Memory of its own, MB, open files and threads of this process."""
    # Not what of files is in memory: that comes and goes with what other programs need.
    (own,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("RssAnon:"))
    folders = {name: len(list(Path(f"/proc/self/{name}").iterdir())) for name in ("fd", "task")}
    return {"memory_mb": int(own.split()[1]) / 1024, **folders}


def digest(result: Any) -> bytes:
    return hashlib.sha256(b"".join(map(np.ndarray.tobytes, (result.disparity, result.reasons)))).digest()


@dataclass(frozen=True)
class Burden:
    """What keeps the cores busy."""

    name: str
    there: Callable[[], bool]


@contextmanager
def busy(processes: int, command: str | None) -> Iterator[Burden]:
    """Run so many busy processes meanwhile, or a program, without its output, and all that it starts."""
    if command is None:
        with burdened(processes):
            yield Burden(f"{processes} busy processes", lambda: True)
        return
    nowhere = subprocess.DEVNULL
    program = subprocess.Popen(shlex.split(command), start_new_session=True, stdout=nowhere, stderr=nowhere)
    try:
        yield Burden(command, lambda: program.poll() is None)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGTERM)
        program.wait()


def soak(
    estimator: DepthEstimator, deadline_ms: float, frames: int, checkpoint: Path, tally: Tally, burden: Burden
) -> dict[str, float]:
    """Run until the tally has so many frames; ends where an answer differs, or the burden is gone."""
    pairs = [(pair.left, pair.right) for pair in sample_pairs()]
    first = [digest(estimator.predict(*pair)) for pair in pairs]
    done, result, before = len(tally.times_ms), None, resources()
    tally.growth_mb.append(0.0)
    tally.beside.append(burden.name)
    for number in progress(range(-WARM_UP, frames - done), unit="frame"):
        if number == 0:
            tally.save(checkpoint)  # takes memory of its own when it is first called
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
            if not burden.there():
                raise SystemExit(f"frame {number}: the program beside has ended")
    after = resources()
    tally.growth_mb[-1] = after["memory_mb"] - before["memory_mb"]
    return {f"more_{name}": after[name] - before[name] for name in ("fd", "task")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--threads", type=int, default=2)
    burden = parser.add_mutually_exclusive_group()
    burden.add_argument("--load", type=int, default=2, help="busy processes beside")
    burden.add_argument("--beside", metavar="COMMAND", help="a program to run beside, in their place")
    parser.add_argument("--deadline-ms", type=float, default=50.0)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    checkpoint = args.json.with_suffix(".npz")
    estimator = DepthEstimator(args.model, threads=args.threads, deadline_ms=args.deadline_ms)
    command = f"python -m benchmarks.speed.soak --model {estimator.model.name} --threads {args.threads}"
    command += f" --load {args.load}" if args.beside is None else f" --beside {shlex.quote(args.beside)}"
    command += f" --deadline-ms {args.deadline_ms:g} --frames {args.frames}"
    made_by = {"command": command, "model_sha256": estimator.model.sha256, "commit": commit(), **versions()}
    tally = Tally.load(checkpoint, made_by)
    with busy(args.load, args.beside) as burden:
        more = soak(estimator, args.deadline_ms, args.frames, checkpoint, tally, burden)
    times = np.array(tally.times_ms)
    p50, p99 = np.percentile(times, (50, 99))
    record = {
        "frames": times.size,
        "beside": tally.beside,
        "runs": len(tally.growth_mb),
        "latency_ms": {"p50": round(p50, 2), "p99": round(p99, 2), "max": round(times.max(), 2)},
        "late": int(np.sum(tally.late)),
        "late_by_the_callers_clock": int(np.sum(times > args.deadline_ms)),
        "marked_in_time": tally.marked_in_time,
        "late_and_unmarked": tally.unmarked,
        "memory_growth_mb": [round(growth, 2) for growth in tally.growth_mb],
        **more,
    }
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})
    checkpoint.unlink(missing_ok=True)
    marks = f"{record['late']} of {times.size} marked late, {tally.unmarked} late and unmarked"
    print(f"p50 {p50:.2f} ms, p99 {p99:.2f} ms, max {times.max():.2f} ms; {marks}")


if __name__ == "__main__":
    main()
