"""``endosdk evaluate``: the error of a model on a data set with truth."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from endosdk.datasets.dataset import DatasetReader
    from endosdk.evaluation.methods import Method


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--model", default="fast", help="shipped name, .onnx file, or sgbm (default: %(default)s)")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data set")
    parser.add_argument(
        "--layout",
        default="endosdk",
        help="how the set is laid out: endosdk, scared, servct, kitti or middlebury (default: %(default)s)",
    )
    parser.add_argument("--split", help="train or test (default: test, or the one whose truth is published)")
    parser.add_argument("--pairs", type=int, help="only the first so many pairs (default: all)")
    parser.add_argument(
        "--network-size",
        metavar="WxH",
        help="size the network works at (default: what the model is made for)",
    )
    parser.add_argument("--provider", default="cpu", help="cpu, cuda, tensorrt (default: %(default)s)")
    parser.add_argument("--threads", type=int, help="processor threads (default: all)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write scores.json there, and the worst ten pairs as pictures"
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate and print a table."""
    from endosdk.datasets.layouts import default_split, open_dataset
    from endosdk.evaluation.methods import evaluate, write_worst
    from endosdk.io.whole_files import write_json
    from endosdk.jobs.machine import machine_record

    method, model = _sgbm(args) if args.model == "sgbm" else _estimator(args)
    split = args.split or default_split(args.layout)
    reader = open_dataset(args.data, split, layout=args.layout)
    scores = evaluate(method, reader, args.pairs)
    for region in ("all", "non_occluded"):
        if region in scores:
            _print_region(region, scores[region])
    print(f"time          {scores['ms_median']:.1f} ms a pair (median)")
    if args.out:
        pictures = write_worst(method, reader, scores, args.out / "worst")
        record = {
            "command": _command(args, reader),
            "model": model,
            "data": {"name": reader.name, "layout": args.layout, "split": split, "sha256": reader.sha256},
            "scores": scores,
            "machine": machine_record(),
        }
        write_json(args.out / "scores.json", record, "out")
        print(f"written       {args.out / 'scores.json'} and {len(pictures)} pictures in {args.out / 'worst'}")
    return 0


def _estimator(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    from endosdk.commands.sizes import parse_size
    from endosdk.evaluation.methods import estimator_method
    from endosdk.runtime.estimator import DepthEstimator

    options = {
        "provider": args.provider,
        "threads": args.threads,
        "network_size": parse_size(args.network_size) if args.network_size else None,
    }
    # Loaded once before any data is read: a wrong option is told at once, and the record names the model that runs,
    # which is another than the one asked for where the processor lacks instructions.
    info = DepthEstimator(args.model, **options).model
    return estimator_method(args.model, **options), {"name": info.name, "version": info.version, "sha256": info.sha256}


def _sgbm(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    from endosdk.errors import InvalidArgument
    from endosdk.evaluation.methods import sgbm_method

    for name, usual in (("network_size", None), ("provider", "cpu"), ("threads", None)):
        if getattr(args, name) != usual:
            raise InvalidArgument(name, "is for models; leave it out with sgbm", getattr(args, name))
    return sgbm_method(filled=True), {"name": "sgbm"}


def _command(args: argparse.Namespace, reader: DatasetReader) -> str:
    """Return the command that measures the same again; of files only their names: no private paths."""
    words = ["endosdk", "evaluate", "--model", Path(args.model).name, "--data", reader.root.resolve().name]
    words += ["--layout", args.layout, "--split", reader.split]
    for name in ("pairs", "network_size", "provider", "threads"):
        if getattr(args, name) is not None:
            words += ["--" + name.replace("_", "-"), str(getattr(args, name))]
    return shlex.join(words)


def _print_region(name: str, measures: dict[str, Any]) -> None:
    if not measures["answered"]:
        print(f"{name:13} no pixel counted: {measures['pixels']} with truth, none of them answered")
        return
    shares = ", ".join(f"{100 * measures[f'kpe_{k}']:.2f} % over {k} px" for k in (1, 2, 3, 5))
    print(f"{name:13} EPE {measures['epe_px']:.4f} px; {shares}")
    if "depth_mae_mm" in measures:
        print(f"{'':13} depth error {measures['depth_mae_mm']:.3f} mm, {100 * measures['depth_relative']:.2f} %")
    print(f"{'':13} {measures['pixels']} pixels with truth, {100 * measures['coverage']:.1f} % answered")
