"""How far a processor's 8-bit integers lead from the same model in floats, on pictures as they are and brightened.

    python -m benchmarks.studies.saturation --data DIR --models fast before=old.onnx --json FILE

Processors without VNNI add two products in 16 bits and stop at their end, which shows at large inputs. A runtime that
may not fuse the layers computes the very same model in floats, where nothing stops. What is left on a model that cannot
saturate is rounding at the steps of 8 bits.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from benchmarks.record import as_given, write_record
from endosdk.datasets.layouts import open_dataset
from endosdk.io.progress import progress
from endosdk.runtime.models import read_model
from endosdk.training.frame_size import seen_size, seen_views

GAINS = (1.0, 2.5)

Feed = dict[str, NDArray[np.uint8]]


def session(model: bytes, *, fused: bool) -> ort.InferenceSession:
    """Open a model in 8-bit integers or, not ``fused``, in floats between every two layers."""
    options = ort.SessionOptions()
    options.log_severity_level = 3
    levels = ort.GraphOptimizationLevel
    options.graph_optimization_level = levels.ORT_ENABLE_ALL if fused else levels.ORT_DISABLE_ALL
    return ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def brightened(view: NDArray[np.uint8], gain: float) -> NDArray[np.uint8]:
    """Multiply grey levels; what exceeds the largest is white, as in glare."""
    return np.clip(view * gain, 0, 255).astype(np.uint8)


def differences(model: bytes, pairs: list[Feed], gain: float) -> dict[str, float]:
    """Mean and 99th percentile, px at the network's width, of how far the two ways to compute are apart."""
    integers, floats = (session(model, fused=fused) for fused in (True, False))
    feeds = [{name: brightened(view, gain) for name, view in pair.items()} for pair in pairs]
    apart = np.abs([integers.run(["disparity"], feed)[0] - floats.run(["disparity"], feed)[0] for feed in feeds])
    white = float(np.mean([(view == 255).mean() for feed in feeds for view in feed.values()]))
    return {"white": white, "mean_px": float(apart.mean()), "p99_px": float(np.quantile(apart, 0.99))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--pairs", type=int, default=20, help="first so many pairs of the test split")
    parser.add_argument("--models", nargs="+", required=True, metavar="NAME[=FILE]")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    reader = open_dataset(args.data, "test")
    models: dict[str, Any] = {}
    hashes: dict[str, str] = {}
    for entry in args.models:
        name, _, path = entry.partition("=")
        file = read_model(path or name)
        metadata = session(file.data, fused=True).get_modelmeta().custom_metadata_map
        pairs: list[Feed] = []
        for index in progress(range(args.pairs), title=name):
            sample = reader[index]
            height, width = sample.left.shape[:2]
            size = seen_size(width, height, int(metadata["endosdk.inference_width"]))
            views = seen_views(sample.left, sample.right, size)
            pairs.append({key: view[None] for key, view in zip(("left", "right"), views, strict=True)})
        by_gain = {f"{gain:g}": differences(file.data, pairs, gain) for gain in GAINS}
        hashes[name] = file.sha256
        models[name] = {"version": metadata["endosdk.version"], "by_gain": by_gain}
        for gain, found in by_gain.items():
            print(f"{name:10} grey levels x {gain:4} mean {found['mean_px']:.3f} px, p99 {found['p99_px']:.3f} px")
    command = f"python -m benchmarks.studies.saturation --data {reader.name} --pairs {args.pairs} "
    command += f"--models {as_given(args.models)}"
    dataset = {"name": reader.name, "split": "test", "pairs": args.pairs, "sha256": reader.sha256}
    found = {"dataset": dataset, "models": models}
    write_record(args.json, found, command=command, hashes={"model_sha256": hashes})


if __name__ == "__main__":
    main()
