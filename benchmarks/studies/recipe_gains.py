"""What each part of the training recipe is worth: the same short run with one part left out.

    python -m benchmarks.studies.recipe_gains --lap DIR --shapes DIR --gi DIR --held-out DIR DIR DIR \\
        --middlebury DIR --runs DIR --json FILE

Every run goes on from the shipped weights, for as many steps, from the same seed. It is judged on pairs of other seeds,
on path-traced pairs and on Middlebury's real truth. One run is the whole recipe from another seed: what differs by less
than these two do is not told apart. A run that is there is not repeated.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.record import write_record
from benchmarks.weights import weights_sha256
from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import default_split, open_dataset
from endosdk.evaluation.scores import ScoreBoard
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.train import train
from endosdk.training.validation import predict_frames

PATH_TRACED = Path(__file__).parents[2] / "datasets" / "endosim-gi-cycles"
LIGHT = ("tone", "colours", "blur", "noise", "glare", "haze", "compression")


def variants(recipe: dict[str, Any], without_objects: tuple[str, ...], seed: int) -> dict[str, dict[str, Any]]:
    """Return what each run changes of the recipe."""
    looks = recipe["looks"]
    return {
        "whole recipe": {},
        "whole recipe, another seed": {"seed": seed + 1},
        "without looks of light and lens": {"looks": tuple(look for look in looks if look not in LIGHT)},
        "without rows that differ": {"looks": tuple(look for look in looks if look != "rows")},
        "without cross-entropy of the volume": {"volume_weight": 0.0},
        "without scenes of mere objects": {"data": without_objects},
    }


def scores(network: StereoNetwork, reader: DatasetReader, pairs: int) -> dict[str, float]:
    """Return the errors over the first so many pairs."""
    board = ScoreBoard()
    for frame in predict_frames(network, reader, range(pairs), title=reader.name):
        board.add(frame.maps[-1], frame.sample.disparity, occlusion=frame.sample.occlusion)
    found = board.result()
    parts = {"epe_px": found["all"]["epe_px"], "over_3px": found["all"]["kpe_3"]}
    return {name: round(value, 4) for name, value in parts.items()}


# What runs are judged on: a set, and how many of its pairs, the first, are taken.
JudgingSets = dict[str, tuple[DatasetReader, int]]


def judging_sets(held_out: list[str], pairs: int, middlebury: Path) -> JudgingSets:
    """Return so many pairs of each held-out set, and all path-traced and all of Middlebury's real ones."""
    readers = {Path(root).name: open_dataset(Path(root), "train") for root in held_out}
    sets = {name: (reader, min(pairs, len(reader))) for name, reader in readers.items()}
    whole = {
        "path-traced": open_dataset(PATH_TRACED, "test"),
        "middlebury": open_dataset(middlebury, default_split("plain"), layout="plain"),
    }
    return {**sets, **{name: (reader, len(reader)) for name, reader in whole.items()}}


def judged(network: StereoNetwork, sets: JudgingSets) -> dict[str, dict[str, float]]:
    """Return the errors of a network on every set."""
    return {name: scores(network.eval(), reader, pairs) for name, (reader, pairs) in sets.items()}


def set_notes(sets: JudgingSets) -> dict[str, dict[str, str]]:
    """Name the sets in a record."""
    return {name: {"name": reader.name, "sha256": reader.sha256} for name, (reader, _) in sets.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in ("lap", "shapes", "gi"):
        parser.add_argument(f"--{kind}", required=True, help=f"set of --organ {kind} to learn from")
    parser.add_argument("--held-out", nargs="+", required=True, help="sets of other seeds")
    parser.add_argument("--middlebury", type=Path, required=True)
    parser.add_argument("--start", default="fast", help="shipped weights")
    parser.add_argument("--pairs", type=int, default=24, help="of each held-out set")
    parser.add_argument("--steps", type=int, default=800)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    sets = judging_sets(args.held_out, args.pairs, args.middlebury)
    given: dict[str, Any] = {"init_from": args.start, "held_out": 0, "steps": args.steps, "threads": 1}
    given |= {"data": (args.gi, args.lap, args.shapes), "rate": 4e-4, "seed": args.seed, "validate_every": args.steps}
    recipe = {**checkpoint.inherited(args.start, given), **given}
    found = {"before": judged(checkpoint.load(checkpoint.starting_point(args.start)).build(), sets)}
    for name, changes in variants(recipe, (args.gi, args.lap), args.seed).items():
        out = args.runs / name.replace(",", "").replace(" ", "-")
        there = (out / checkpoint.LAST).exists()
        if not there or checkpoint.load(out).step < args.steps:
            train(TrainConfig.from_dict({**recipe, **changes}), out, resume=there)
        found[name] = judged(checkpoint.load(out).build(), sets)
        print(name, found[name], flush=True)
        record = {
            "datasets": set_notes(sets),
            "learned_from": {
                root: open_dataset(Path(getattr(args, root)), "train").sha256 for root in ("gi", "lap", "shapes")
            },
            "recipe": {key: value for key, value in recipe.items() if key != "data"},
            "runs": found,
        }
        command = f"python -m benchmarks.studies.recipe_gains --start {args.start} --pairs {args.pairs} "
        command += f"--steps {args.steps} --seed {args.seed} ..."
        write_record(args.json, record, command=command, hashes={"start_sha256": weights_sha256(args.start)})


if __name__ == "__main__":
    main()
