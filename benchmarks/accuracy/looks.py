"""What it costs a model when pictures look otherwise than those that it has learned from.

    python -m benchmarks.accuracy.looks --data DIR --models fast fast-320 accurate --json FILE

The same pairs are shown as they are and with one change: red and blue exchanged in both views, both views grey, or the
rows of the right view one pixel lower. Scenes and truth stay, so that the errors of a model differ by the look alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.model_run import model_run
from benchmarks.record import as_given, write_record
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.frame_parts import Picture
from endosdk.evaluation.methods import Method, estimator_method
from endosdk.evaluation.scores import ScoreBoard
from endosdk.io.progress import progress

Look = Callable[[Sample], Sample]


def in_both(change: Callable[[Picture], Picture]) -> Look:
    """Return the look that changes both views in the same way."""
    return lambda sample: replace(sample, left=change(sample.left), right=change(sample.right))


def exchanged(view: Picture) -> Picture:
    """Exchange the red and the blue of a view [H, W, 3]."""
    return np.ascontiguousarray(view[..., ::-1])


def grey(view: Picture) -> Picture:
    """Return the brightness of a view [H, W, 3] in all its channels."""
    return np.repeat(cv2.cvtColor(view, cv2.COLOR_RGB2GRAY)[..., None], 3, axis=2)


def one_row_lower(sample: Sample) -> Sample:
    """Move the right view down by 1 px; its first row stays."""
    return replace(sample, right=np.concatenate([sample.right[:1], sample.right[:-1]]))


LOOKS: dict[str, Look] = {
    "as rendered": lambda sample: sample,
    "red and blue exchanged": in_both(exchanged),
    "grey": in_both(grey),
    "right view 1 px lower": one_row_lower,
}


def measure(method: Method, reader: DatasetReader, pairs: int) -> dict[str, dict[str, Any]]:
    """Return the pooled errors of a method over the first so many pairs, and its share of valid pixels, by look."""
    boards = {name: ScoreBoard() for name in LOOKS}
    for index in progress(range(pairs)):
        sample = reader[index]
        for name, look in LOOKS.items():
            answer = method(look(sample))
            boards[name].add(answer.disparity, sample.disparity, valid=answer.valid)
    found = {}
    for name, board in boards.items():
        scores = board.result()
        found[name] = {key: scores["all"][key] for key in ("epe_px", "kpe_1", "kpe_3")}
        found[name]["valid"] = scores["valid"]["share"]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--pairs", type=int, default=100, help="first so many pairs of the test split")
    parser.add_argument("--models", nargs="+", required=True, help="shipped names or .onnx files")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    reader = open_dataset(args.data, "test")
    pairs = min(args.pairs, len(reader))
    found = {}
    for name in args.models:
        found[name] = measure(estimator_method(name), reader, pairs)
        for look, errors in found[name].items():
            print(f"{name:10} {look:24} {errors['epe_px']:.3f} px, over 3 px {100 * errors['kpe_3']:.2f} %")
    command = f"python -m benchmarks.accuracy.looks --data {reader.name} --pairs {args.pairs} "
    command += f"--models {as_given(args.models)}"
    dataset = {"name": reader.name, "split": "test", "pairs": pairs, "sha256": reader.sha256}
    hashes = {"models": {name: model_run(name).sha256 for name in args.models}}
    write_record(args.json, {"dataset": dataset, "looks": found}, command=command, hashes=hashes)


if __name__ == "__main__":
    main()
