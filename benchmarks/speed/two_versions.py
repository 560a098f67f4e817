"""Two installed versions of endosdk side by side: the error of each, and the time of a frame, in turns.

    python -m benchmarks.speed.two_versions --before PYTHON --after PYTHON --commits COMMIT COMMIT --json FILE

Each PYTHON is the interpreter of an environment with one version. Both compute a shipped pair with the models they
ship, on two threads; times count only where both are right. In each turn one version works while the other sleeps.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.record import write_record
from endosdk.commands.options import parse_size
from endosdk.datasets.samples import RawPair, sample_pairs
from endosdk.io.progress import progress

TURNS, FRAMES = 100, 16
LARGEST_ERROR = 1e-3  # of the width, on average

# What one version runs. It stands on names that have not changed since 0.1.0, and answers one line for each line.
WORKER = """
import json, sys, time
from collections import deque
from itertools import repeat
import numpy as np
import endosdk
WAITING = 4
name, folder = sys.argv[1:]
left, right = np.load(folder + "/left.npy"), np.load(folder + "/right.npy")
rig = endosdk.StereoCalibration.load(folder + "/rig.json")
estimator = endosdk.DepthEstimator(name, calibration=rig, threads=2)
result = estimator.predict(left, right)
for line in sys.stdin:
    kind, count = line.split()
    if kind == "save":
        np.save(count, result.disparity)
    if kind == "hash":
        print(json.dumps(estimator.model.sha256), flush=True)
        continue
    results = estimator.stream(repeat((left, right), int(count) + WAITING), reuse=True) if kind == "stream" else None
    for _ in range(WAITING if results else 0):  # until the stream is full
        next(results)
    started = time.perf_counter()
    if kind == "calls":
        for _ in range(int(count)):
            estimator.predict(left, right, out=result)
    if results:
        deque(results, maxlen=0)
    print(json.dumps(time.perf_counter() - started), flush=True)
"""


Times = dict[str, list[float]]  # ms a frame of each version, by turn


class Version:
    """One version at work in a process of its own."""

    def __init__(self, python: Path, model: str, folder: Path) -> None:
        command = [python, "-c", WORKER, model, folder]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder)

    def ask(self, line: str) -> Any:
        """Let it do one thing; return for how long, s, or the hash of its model file."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(line, file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def compare(model: str, pair: RawPair, interpreters: dict[str, Path], folder: Path) -> dict[str, Any]:
    """Check that the disparity of both versions is right, then time them in turns."""
    np.save(folder / "left.npy", pair.left)
    np.save(folder / "right.npy", pair.right)
    pair.calibration.save(folder / "rig.json")
    height, width = pair.left.shape[:2]
    versions = {label: Version(python, model, folder) for label, python in interpreters.items()}
    try:
        errors, hashes = {}, {}
        for label, version in versions.items():
            hashes[label] = version.ask("hash 0")
            version.ask(f"save {folder / label}.npy")
            errors[label] = float(np.nanmean(np.abs(np.load(folder / f"{label}.npy") - pair.disparity)))
            if errors[label] > LARGEST_ERROR * width:
                raise SystemExit(f"{model}, {label}: off by {errors[label]:.3g} px, so its times say nothing")
        ms: dict[str, dict[str, list[float]]] = {
            kind: {label: [] for label in versions} for kind in ("calls", "stream")
        }
        for turn in progress(range(TURNS + 1), unit="turn", title=f"{model} {width}x{height}"):
            # The one that begins changes with the turn, so that neither always finds the warmer machine.
            order = list(versions.items())[:: 1 if turn % 2 else -1]
            for kind in ms:
                for label, version in order:
                    seconds = version.ask(f"{kind} {FRAMES}")
                    if turn:  # the first warms up
                        ms[kind][label].append(1000 * seconds / FRAMES)
    finally:
        for version in versions.values():
            version.close()
    times = {kind: _times(each) for kind, each in ms.items()}
    return {"model": model, "size": [width, height], "sha256": hashes, "mean_error_px": errors, **times}


def _times(ms: Times) -> dict[str, Any]:
    ratios = [after / before for before, after in zip(ms["before"], ms["after"], strict=True)]
    medians = {f"{label}_ms": round(statistics.median(values), 3) for label, values in ms.items()}
    low, middle, high = (round(value, 4) for value in np.percentile(ratios, (25, 50, 75)))
    return {**medians, "ratio_quartiles": [low, middle, high]}


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, metavar="PYTHON")
    parser.add_argument("--after", type=Path, required=True, metavar="PYTHON")
    parser.add_argument("--commits", nargs=2, required=True, metavar="COMMIT", help="of both versions")
    parser.add_argument("--models", nargs="+", default=["fast", "fast-320"], metavar="NAME", help="that both ship")
    parser.add_argument("--sizes", nargs="+", type=parse_size, default=[(960, 720)], metavar="WxH")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")
    args = parser.parse_args()
    interpreters = {"before": args.before, "after": args.after}
    with tempfile.TemporaryDirectory() as name:
        models = [
            compare(model, sample_pairs()[0].resized(*size), interpreters, Path(name))
            for model in args.models
            for size in args.sizes
        ]
    # The rows of the later version's numbers are marked by its files.
    hashes = {
        key: {found["model"]: found["sha256"][label] for found in models}
        for key, label in (("before_sha256", "before"), ("model_sha256", "after"))
    }
    commits, sizes = " ".join(args.commits), " ".join(f"{width}x{height}" for width, height in args.sizes)
    record = {
        "commits": dict(zip(("before", "after"), args.commits, strict=True)),
        "threads": 2,
        "turns": TURNS,
        "frames_a_turn": FRAMES,
        "models": models,
    }
    command = (
        f"python -m benchmarks.speed.two_versions --before PYTHON --after PYTHON --commits {commits} "
        f"--models {' '.join(args.models)} --sizes {sizes}"
    )
    write_record(args.json, record, command=command, hashes=hashes)
    print(json.dumps(models, indent=1))


if __name__ == "__main__":
    main()
