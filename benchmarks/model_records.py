"""Command line and record of the benchmarks that measure one model after another on a data set."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.model_run import model_run
from benchmarks.record import signed
from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument
from endosdk.io.whole_files import write_json


def models_parser(description: str | None, pairs_help: str) -> argparse.ArgumentParser:
    """Declare the arguments that these benchmarks share."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--split", default="test")
    parser.add_argument("--pairs", type=int, default=20, help=pairs_help)
    parser.add_argument("--models", nargs="+", default=["fast", "wang2020"])
    parser.add_argument("--json", type=Path, required=True)
    return parser


def evenly(count: int, there: int) -> list[int]:
    """Return at most ``count`` numbers of pairs, evenly from all that are there."""
    count = min(count, there)
    return [number * there // count for number in range(count)]


def record_models(
    args: argparse.Namespace,
    reader: DatasetReader,
    measure: Callable[[str], dict[str, Any]],
    more: str = "",
    part: str | None = None,
) -> None:
    """Measure every model asked for, write the record, and print it; ``more`` are options of this benchmark alone.

    What was measured of other models stays, and so do the other entries of a ``part`` of which only some are measured.
    Raises InvalidArgument before anything is measured where the file is about other pairs or another model file.
    """
    dataset = {"name": reader.name, "split": args.split, "sha256": reader.sha256}
    before = json.loads(args.json.read_text()) if args.json.is_file() else {"dataset": dataset, "models": {}}
    if before["dataset"] != dataset:
        raise InvalidArgument("data", f"must be that of {args.json.name}, {before['dataset']}", dataset)
    models = before["models"]
    hashes = {model: model_run(model).sha256 for model in args.models}
    joined = {model: models[model][part] for model in args.models if part is not None and model in models}
    for model, entries in joined.items():
        _check_joins(
            f"{model} in {args.json.name}", models[model], entries, hashes[model], min(args.pairs, len(reader))
        )
    program = f"python -m {sys.modules['__main__'].__spec__.name}"
    data = f"--data {reader.name} --split {args.split} --pairs {args.pairs}{more}"
    for model, sha256 in hashes.items():
        signature: Any = {"command": f"{program} {data} --models {model}", "hashes": {"model_sha256": sha256}}
        found = measure(model)
        if part is not None and model in joined:
            # The signature of the model is that of the entries that stay: the new ones have their own.
            signed_apart = {name: signed(one, **signature) for name, one in found[part].items()}
            models[model][part] = {**joined[model], **signed_apart}
        else:
            models[model] = signed(found, **signature)
    write_json(args.json, {"dataset": dataset, "models": models})
    print(json.dumps(models, indent=1))


def _check_joins(where: str, record: dict[str, Any], entries: dict[str, Any], sha256: str, pairs: int) -> None:
    """Raise InvalidArgument where new entries would stand beside those of another file or of other pairs."""
    if record["model_sha256"] != sha256:
        raise InvalidArgument("models", f"must have the SHA-256 of {where}, {record['model_sha256']}", sha256)
    for name, one in entries.items():
        if one["pairs"] != pairs:
            raise InvalidArgument("pairs", f"must be {one['pairs']}, as of {name} of {where}", pairs)
