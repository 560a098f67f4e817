"""Command line and record of the benchmarks that measure one model after another on a data set."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.record import signed
from endosdk.datasets.dataset import DatasetReader
from endosdk.io.whole_files import write_json
from endosdk.runtime.models import read_model


def models_parser(description: str | None, pairs_help: str) -> argparse.ArgumentParser:
    """Declare the arguments that these benchmarks share."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--split", default="test")
    parser.add_argument("--pairs", type=int, default=20, help=pairs_help)
    parser.add_argument("--models", nargs="+", default=["fast", "wang2020"])
    parser.add_argument("--json", type=Path, required=True)
    return parser


def record_models(
    args: argparse.Namespace, reader: DatasetReader, measure: Callable[[str], dict[str, Any]], more: str = ""
) -> None:
    """Measure every model asked for, write the record, and print it; ``more`` are options of this benchmark alone."""
    # A model that is not run keeps what the file says of it.
    models = json.loads(args.json.read_text())["models"] if args.json.is_file() else {}
    program = f"python -m {sys.modules['__main__'].__spec__.name}"
    data = f"--data {reader.name} --split {args.split} --pairs {args.pairs}{more}"
    for model in args.models:
        hashes = {"model_sha256": read_model(model).sha256}
        models[model] = signed(measure(model), command=f"{program} {data} --models {model}", hashes=hashes)
    dataset = {"name": reader.name, "split": args.split, "sha256": reader.sha256}
    write_json(args.json, {"dataset": dataset, "models": models})
    print(json.dumps(models, indent=1))
