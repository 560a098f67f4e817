"""What studies of short training runs share: their options, what runs are judged on, the runs, and the record."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.record import as_given, write_record
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
KINDS = ("gi", "lap", "shapes")  # of the sets to learn from


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


def study_parser(description: str) -> argparse.ArgumentParser:
    """Return a parser of the options that all studies of short runs have."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in KINDS:
        parser.add_argument(f"--{kind}", required=True, help=f"set of --organ {kind} to learn from")
    parser.add_argument("--held-out", nargs="+", required=True, help="sets of other seeds")
    parser.add_argument("--middlebury", type=Path, required=True)
    parser.add_argument("--start", default="fast", help="shipped weights")
    parser.add_argument("--pairs", type=int, default=24, help="of each held-out set")
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--json", type=Path, required=True)
    return parser


def learning_sets(args: argparse.Namespace) -> tuple[str, ...]:
    """Return the folders of the sets to learn from."""
    return tuple(getattr(args, kind) for kind in KINDS)


def said_of(args: argparse.Namespace) -> str:
    """Return the options of a study as its record has them: all but the folder of its runs, and the record."""
    words = []
    for name, value in vars(args).items():
        if name not in ("runs", "json"):
            words += [f"--{name.replace('_', '-')}", *map(str, value if isinstance(value, list) else [value])]
    return as_given(words)


class Variant(NamedTuple):
    """One run of a study."""

    folder: str  # its name within --runs
    changes: Mapping[str, Any]  # what it sets otherwise than the recipe
    fit: Callable[..., object] = train  # takes the settings, the folder, and whether the run there goes on


def run_variants(
    args: argparse.Namespace,
    sets: JudgingSets,
    given: dict[str, Any],
    variants: Mapping[str, Variant],
    command: str,
) -> None:
    """Train and judge every variant, and the weights that they start from; the record grows with each of them.

    The recipe is that of the weights, with what is ``given``. A run that is there goes on, or is judged at once where
    it has ``args.steps`` steps; one of other settings or data is refused.
    """
    recipe = {**checkpoint.inherited(args.start, given), **given}
    found = {"before": judged(checkpoint.load(checkpoint.starting_point(args.start)).build(), sets)}
    for name, variant in variants.items():
        out = args.runs / variant.folder
        # A run that is there goes on, or ends at once; one of other settings or data is refused.
        there = (out / checkpoint.LAST).exists()
        variant.fit(TrainConfig.from_dict({**recipe, **variant.changes}), out, resume=there)
        found[name] = judged(checkpoint.load(out).build(), sets)
        print(name, found[name], flush=True)
        record = _record(args, sets, recipe, found)
        write_record(args.json, record, command=command, hashes={"start_sha256": weights_sha256(args.start)})


def _record(
    args: argparse.Namespace, sets: JudgingSets, recipe: dict[str, Any], runs: dict[str, Any]
) -> dict[str, Any]:
    """Say what was judged on what, and what it has learned from."""
    return {
        "datasets": {name: {"name": reader.name, "sha256": reader.sha256} for name, (reader, _) in sets.items()},
        "learned_from": {
            kind: open_dataset(Path(root), "train").sha256
            for kind, root in zip(KINDS, learning_sets(args), strict=True)
        },
        "recipe": {key: value for key, value in recipe.items() if key != "data"},
        "runs": runs,
    }
