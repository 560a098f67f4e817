"""What it costs to find out whether an answer can be trusted: milliseconds, and as a share of a frame's time.

    python -m benchmarks.speed.trust_cost --json benchmarks/results/speed/trust_cost.json

The demonstration pair, at 960 x 720 with its calibration, comes in turns as it is, seen through a circle, and by a rig
that has turned, so that sigma grows. Before a time counts, each must be called what it is. It needs a quiet machine.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.record import write_record
from endosdk import Cause, DepthEstimator, DepthResult, Reason, Status, StereoCalibration
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Picture

DATA = Path(__file__).parents[2] / "examples" / "data"
ROUNDS, SETTLED = 60, 10
TARGET = 0.05  # of a frame
TURN_DEG = (0.0, 0.0, 0.4)


@dataclass
class Case:
    """One pair and the estimator that sees nothing else."""

    pair: tuple[Picture, Picture]
    estimator: DepthEstimator
    trust_ms: list[float] = field(default_factory=list)
    frame_ms: list[float] = field(default_factory=list)

    def answer(self) -> DepthResult:
        """Answer the pair once more and note what that took; a bit changes, so that it does not look frozen."""
        for view in self.pair:
            view[0, 0, 0] ^= 1
        before = self._trust_ms()
        result = self.estimator.predict(*self.pair)
        self.trust_ms.append(self._trust_ms() - before)
        self.frame_ms.append(result.timings.total_ms)
        return result

    def _trust_ms(self) -> float:
        """Of all frames so far."""
        report = self.estimator.diagnostics()
        return float(report["frames"] * report["mean_ms"]["trust"])

    def result(self) -> dict[str, float]:
        """Return medians of the settled frames."""
        trust, frame = (np.array(times[SETTLED:]) for times in (self.trust_ms, self.frame_ms))
        return {
            "trust_ms": round(float(np.median(trust)), 3),
            "frame_ms": round(float(np.median(frame)), 3),
            "share_of_a_frame": round(float(np.median(trust / frame)), 4),
        }


def circled(view: Picture) -> Picture:
    """A view whose optics fill a circle; dark and noisy outside."""
    rows, columns = np.indices(view.shape[:2])
    inside = np.hypot(columns - view.shape[1] / 2, rows - view.shape[0] / 2) < 0.55 * view.shape[0]
    dark = np.random.default_rng(0).normal(5, 1, view.shape)
    return np.where(inside[..., None], np.maximum(view, 30), dark).clip(0, 255).astype(np.uint8)


def cases(model: str, threads: int) -> dict[str, Case]:
    rig = StereoCalibration.load(DATA / "rig.json")
    left, right = (read_frame(DATA / "demo" / f"{side}.png") for side in ("left", "right"))
    found = {
        "tissue": ((left.copy(), right.copy()), rig),
        "round field of view": ((circled(left), circled(right)), rig),
        "rig that has turned": ((left, right), rig.turned(TURN_DEG)),
    }
    return {
        name: Case(pair, DepthEstimator(model, calibration=known, threads=threads))
        for name, (pair, known) in found.items()
    }


def check(name: str, result: DepthResult) -> None:
    """End the run: of a frame that is called something else nobody wants the time."""
    outside = float(np.mean((result.reasons & Reason.OUTSIDE_VIEW) != 0))
    right = {
        "tissue": result.status is Status.OK and outside == 0,
        "round field of view": result.status is Status.OK and 0.2 < outside < 0.4,
        "rig that has turned": Cause.RIG_MOVED in result.causes,
    }
    if not right[name]:
        raise SystemExit(f"{name}: {result.status}, {result.causes}, {outside:.1%} outside")


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    measured = cases(args.model, args.threads)
    for _ in range(ROUNDS):
        for name, case in measured.items():
            check(name, case.answer())
    record = {
        "allowed_share": TARGET,
        "cases": {name: case.result() for name, case in measured.items()},
        "load_average": [round(load, 2) for load in os.getloadavg()],  # other work on the machine blurs the times
    }
    command = f"python -m benchmarks.speed.trust_cost --model {args.model} --threads {args.threads}"
    estimator = next(iter(measured.values())).estimator
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})
    print(record["cases"])


if __name__ == "__main__":
    main()
