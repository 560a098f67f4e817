"""The files that ship beside earlier files of the same weights: error, difference of the answers, and time of a frame.

    python -m benchmarks.speed.earlier_files --earlier DIR --data DIR --models fast fast-320 accurate --json FILE

DIR holds the earlier files under the names of the shipped ones. Both answer every pair, in turns. The tables show what
was measured with an earlier file that this record names, and mark it.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.model_run import model_run
from benchmarks.record import signed
from endosdk import DepthEstimator
from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import open_dataset
from endosdk.io.progress import progress
from endosdk.io.whole_files import write_json

LARGEST_DIFFERENCE_PX = 0.05  # on average; files of other weights differ by more


def compare(earlier: Path, model: str, reader: DatasetReader, pairs: int) -> dict[str, Any]:
    """Return error and time of both files, and how far their answers differ. Stops where weights cannot be the same."""
    estimators = {"earlier": DepthEstimator(earlier, threads=2), "shipped": DepthEstimator(model, threads=2)}
    times: dict[str, list[float]] = {name: [] for name in estimators}
    errors: dict[str, list[float]] = {name: [] for name in estimators}
    differences, changed = [], []
    for number in progress(range(pairs)):
        sample = reader[number]
        results = {}
        for name, estimator in estimators.items():
            estimator.predict(sample.left, sample.right)  # finds the caches as the other file has left them
            started = time.perf_counter()
            results[name] = estimator.predict(sample.left, sample.right)
            times[name].append(1000 * (time.perf_counter() - started))
            errors[name].append(float(np.nanmean(np.abs(results[name].disparity - sample.disparity))))
        one, other = results.values()
        differences.append(float(np.mean(np.abs(one.disparity - other.disparity))))
        changed.append(float(np.mean((one.reasons == 0) != (other.reasons == 0))))
    difference = statistics.mean(differences)
    if difference > LARGEST_DIFFERENCE_PX:
        raise SystemExit(f"{model}: answers differ by {difference:.3f} px: not the same weights")
    ms = {name: statistics.median(found) for name, found in times.items()}
    return {
        "pairs": pairs,
        "size": [sample.left.shape[1], sample.left.shape[0]],
        "epe_px": {name: statistics.mean(found) for name, found in errors.items()},
        "mean_difference_px": difference,
        "validity_differs": statistics.mean(changed),
        "median_ms": ms,
        "times_faster": ms["earlier"] / ms["shipped"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--earlier", type=Path, required=True, help="folder with the earlier files")
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--pairs", type=int, default=40, help="the first so many test pairs")
    parser.add_argument("--models", nargs="+", required=True)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    reader = open_dataset(args.data, "test")
    models = {}
    for model in args.models:
        earlier = args.earlier / f"{model}.onnx"
        found = compare(earlier, model, reader, args.pairs)
        hashes = {"model_sha256": model_run(model).sha256, "earlier_sha256": model_run(earlier).sha256}
        options = f"--earlier DIR --data {reader.name} --pairs {args.pairs} --models {model}"
        models[model] = signed(found, command=f"python -m benchmarks.speed.earlier_files {options}", hashes=hashes)
        print(model, found)
    write_json(args.json, {"dataset": {"name": reader.name, "sha256": reader.sha256}, "models": models})


if __name__ == "__main__":
    main()
