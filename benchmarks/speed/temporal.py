"""What `stream(temporal=True)` costs: milliseconds of a frame's post-processing with the filter and without, in turns.

    python -m benchmarks.speed.temporal --json benchmarks/results/speed/temporal.json

The demonstration pair stands still under new noise in every frame. Before a time counts, its answers must be steadier
than those without the filter. It needs a quiet machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.record import write_record
from endosdk import DepthEstimator, DepthResult
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Picture

DEMO = Path(__file__).parents[2] / "examples" / "data" / "demo"
FRAMES, ROUNDS, SETTLED = 24, 5, 4
NOISE = 4.0  # grey levels
LIMIT = 0.10  # of a frame


def film() -> list[tuple[Picture, Picture]]:
    """Return pairs of one scene, each with noise of its own."""
    rng = np.random.default_rng(0)
    pair = [read_frame(DEMO / f"{side}.png").astype(np.float32) for side in ("left", "right")]

    def noisy(view: np.ndarray) -> Picture:
        return np.clip(view + rng.normal(0, NOISE, view.shape), 0, 255).astype(np.uint8)

    return [(noisy(pair[0]), noisy(pair[1])) for _ in range(FRAMES)]


def steadiness(results: list[DepthResult]) -> float:
    """Return the standard deviation in time of the pixel in the middle, px: edges jump with noise, filter or not."""
    return float(np.median(np.stack([one.disparity for one in results]).std(axis=0)))


def in_turns(
    estimator: DepthEstimator, frames: list[tuple[Picture, Picture]]
) -> Iterator[tuple[bool, list[DepthResult]]]:
    """Yield the settled answers with the filter and without, in turns."""
    for turn in range(2 * ROUNDS):
        temporal = turn % 2 == 1
        yield temporal, list(estimator.stream(iter(frames), temporal=temporal))[SETTLED:]


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    estimator = DepthEstimator(args.model, threads=args.threads)
    times: dict[bool, list[float]] = {False: [], True: []}
    totals: list[float] = []
    flicker: dict[bool, float] = {}
    for temporal, results in in_turns(estimator, film()):
        times[temporal] += [one.timings.postprocess_ms for one in results]
        if not temporal:
            totals += [one.timings.total_ms for one in results]
        flicker[temporal] = steadiness(results)
    if not flicker[True] < 0.7 * flicker[False]:
        raise SystemExit(
            f"the filter does not steady: flicker {flicker[True]:.4f} px with it, {flicker[False]:.4f} without"
        )
    plain, steady, total = (float(np.median(part)) for part in (times[False], times[True], totals))
    record = {
        "filter_ms": round(steady - plain, 3),
        "frame_ms": round(total, 3),
        "share_of_a_frame": round((steady - plain) / total, 4),
        "flicker_px": {"without": round(flicker[False], 4), "with": round(flicker[True], 4)},
        "allowed_share": LIMIT,
    }
    command = f"python -m benchmarks.speed.temporal --model {args.model} --threads {args.threads}"
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})
    print(record)


if __name__ == "__main__":
    main()
