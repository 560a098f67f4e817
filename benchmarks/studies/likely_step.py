"""What the pictures' own correction of the coarse map brings wang2020: the same weights without it and with it.

    python -m benchmarks.studies.likely_step --data DIR --weights wang2020 --json FILE

Both are model files that go through the whole frame path. With ``--held-out`` the last so many training pairs are
scored, and there further dampings may be tried; the test split is for the one that is shipped.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.record import as_given, write_part
from benchmarks.weights import weights_sha256
from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.methods import estimator_method
from endosdk.evaluation.scores import ScoreBoard
from endosdk.io.progress import progress
from endosdk.training import checkpoint
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks import photometric

COLUMNS = ("epe_px", "kpe_1", "kpe_3", "pixels")
ALONE, CORRECTED = "wang2020", "wang2020-photometric"


def measure(weights: str, reader: DatasetReader, indices: range, doubts: list[float]) -> dict[str, Any]:
    """Errors of the network alone and, for every damping, with the correction."""
    trained = checkpoint.load(checkpoint.starting_point(weights))
    ways = {"alone": (ALONE, photometric.DOUBT)}
    ways |= {f"corrected, damping {doubt:g}": (CORRECTED, doubt) for doubt in doubts}
    shipped = photometric.DOUBT
    found = {}
    for way, (network, doubt) in ways.items():
        photometric.DOUBT = doubt
        board = ScoreBoard()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "model.onnx"
            form = replace(trained, config=replace(trained.config, network=network)).build()
            export_model(form, file, ModelDescription("wang2020", "0"))
            answer = estimator_method(str(file))
            for index in progress(indices, title=way):
                sample = reader[index]
                board.add(answer(sample).disparity, sample.disparity)
        found[way] = {key: board.result()["all"][key] for key in COLUMNS}
        print(f"{weights:10} {way:24} EPE {found[way]['epe_px']:.4f} px, over 1 px {100 * found[way]['kpe_1']:.2f} %")
    photometric.DOUBT = shipped
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--held-out", type=int, help="the last so many training pairs instead of the test split")
    parser.add_argument("--pairs", type=int, help="only the first so many pairs of the test split")
    parser.add_argument("--weights", nargs="+", default=["wang2020"], metavar="NAME[=FILE]")
    parser.add_argument("--dampings", nargs="+", type=float, default=[photometric.DOUBT])
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    split = "train" if args.held_out else "test"
    reader = open_dataset(args.data, split)
    first = max(0, len(reader) - args.held_out) if args.held_out else 0
    indices = range(first, min(len(reader), first + (args.held_out or args.pairs or len(reader))))
    data = {"name": reader.name, "split": split, "pairs": [indices.start, indices.stop], "sha256": reader.sha256}
    some = f" --held-out {args.held_out}" if args.held_out else f" --pairs {args.pairs}" if args.pairs else ""
    dampings = " ".join(f"{doubt:g}" for doubt in args.dampings)
    for entry in args.weights:
        name, _, file = entry.partition("=")
        found = measure(file or name, reader, indices, args.dampings)
        command = f"python -m benchmarks.studies.likely_step --data {reader.name}{some} --weights {as_given([entry])} "
        write_part(
            args.json,
            f"{name} on {reader.name}, {split}",
            {"dataset": data, "ways": found},
            command=f"{command}--dampings {dampings}",
            hashes={"weights_sha256": weights_sha256(file or name)},
        )


if __name__ == "__main__":
    main()
