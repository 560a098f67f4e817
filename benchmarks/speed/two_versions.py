"""Two installed versions of endosdk side by side: the same maps, and the time of a frame, in turns.

    python -m benchmarks.speed.two_versions --before PYTHON --after PYTHON --commits COMMIT COMMIT --json FILE

Each PYTHON is the interpreter of an environment with one version. Both compute the shipped pairs with the models they
ship, on two threads; only models whose maps agree are timed. In each turn one version works while the other sleeps.
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
from endosdk.datasets.samples import sample_pairs
from endosdk.io.progress import progress
from endosdk.runtime.models import read_model

MODELS = ("fast", "fast-320")
SIZE = (960, 720)
TURNS, FRAMES = 100, 16
TOLERANCE_PX = 1e-4

# What one version runs. It stands on names that have not changed since 0.1.0, and answers one line for each line.
WORKER = """
import json, sys, time
from collections import deque
from itertools import repeat
import numpy as np
import endosdk
name, folder = sys.argv[1:]
left, right = np.load(folder + "/left.npy"), np.load(folder + "/right.npy")
rig = endosdk.StereoCalibration.load(folder + "/rig.json")
estimator = endosdk.DepthEstimator(name, calibration=rig, threads=2)
result = estimator.predict(left, right)
for line in sys.stdin:
    kind, count = line.split()
    if kind == "save":
        np.save(count, result.disparity)
    started = time.perf_counter()
    if kind == "calls":
        for _ in range(int(count)):
            estimator.predict(left, right, out=result)
    if kind == "stream":
        deque(estimator.stream(repeat((left, right), int(count)), reuse=True), maxlen=0)
    print(json.dumps(time.perf_counter() - started), flush=True)
"""


Times = dict[str, list[float]]  # ms a frame of each version, by turn


class Version:
    """One version at work in a process of its own."""

    def __init__(self, python: Path, model: str, folder: Path) -> None:
        command = [python, "-c", WORKER, model, folder]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder)

    def ask(self, line: str) -> float:
        """Let it do one thing; return for how long, s."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(line, file=self._process.stdin, flush=True)
        return float(json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def compare(model: str, interpreters: dict[str, Path], folder: Path) -> dict[str, Any]:
    """Check that both versions give the same disparity, then time them in turns."""
    versions = {label: Version(python, model, folder) for label, python in interpreters.items()}
    try:
        maps = []
        for label, version in versions.items():
            version.ask(f"save {folder / label}.npy")
            maps.append(np.load(folder / f"{label}.npy"))
        apart = float(np.nanmax(np.abs(maps[0] - maps[1])))
        if apart > TOLERANCE_PX:
            raise SystemExit(f"{model}: the two versions differ by {apart:.3g} px, so their times say nothing")
        ms: dict[str, dict[str, list[float]]] = {
            kind: {label: [] for label in versions} for kind in ("calls", "stream")
        }
        for turn in progress(range(TURNS + 1), unit="turn", title=model):
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
    return {"model": model, "largest_difference_px": apart, **{kind: _times(each) for kind, each in ms.items()}}


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
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")
    args = parser.parse_args()
    pair = sample_pairs()[0].resized(*SIZE)
    hashes = {model: read_model(model).sha256 for model in MODELS}  # as this checkout ships them
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.save(folder / "left.npy", pair.left)
        np.save(folder / "right.npy", pair.right)
        pair.calibration.save(folder / "rig.json")
        models = [compare(model, {"before": args.before, "after": args.after}, folder) for model in MODELS]
    commits = " ".join(args.commits)
    record = {
        "commits": dict(zip(("before", "after"), args.commits, strict=True)),
        "size": list(SIZE),
        "threads": 2,
        "turns": TURNS,
        "frames_a_turn": FRAMES,
        "models": models,
    }
    command = f"python -m benchmarks.speed.two_versions --before PYTHON --after PYTHON --commits {commits}"
    write_record(args.json, record, command=command, hashes={"model_sha256": hashes})
    print(json.dumps(models, indent=1))


if __name__ == "__main__":
    main()
