"""``endosdk evaluate``: the error of a model on a data set with truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


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
    from endosdk.bench import write_record
    from endosdk.commands.sizes import parse_size
    from endosdk.dataset_layouts import open_dataset, usual_split
    from endosdk.evaluation import estimator_method, evaluate, sgbm_method, write_worst
    from endosdk.machine import machine_record

    split = args.split or usual_split(args.layout)
    reader = open_dataset(args.data, split, layout=args.layout)
    if args.model == "sgbm":
        method = sgbm_method(filled=True)
    else:
        size = parse_size(args.network_size) if args.network_size else None
        method = estimator_method(args.model, provider=args.provider, threads=args.threads, network_size=size)
    scores = evaluate(method, reader, args.pairs)
    for region in ("all", "non_occluded"):
        if region in scores:
            _print_region(region, scores[region])
    print(f"time          {scores['ms_median']:.1f} ms a pair (median)")
    if args.out:
        pictures = write_worst(method, reader, scores, args.out / "worst")
        options = f"--layout {args.layout} --split {split}"
        command = f"endosdk evaluate --model {args.model} --data {reader.root.name} {options}"
        data = {"name": reader.name, "layout": args.layout, "split": split, "sha256": reader.sha256}
        record = {"command": command, "data": data, "scores": scores, "machine": machine_record()}
        write_record(args.out / "scores.json", record)
        print(f"written       {args.out / 'scores.json'} and {len(pictures)} pictures in {args.out / 'worst'}")
    return 0


def _print_region(name: str, measures: dict[str, Any]) -> None:
    shares = ", ".join(f"{100 * measures[f'kpe_{k}']:.2f} % over {k} px" for k in (1, 2, 3, 5))
    print(f"{name:13} EPE {measures['epe_px']:.4f} px; {shares}")
    if "depth_mae_mm" in measures:
        print(f"{'':13} depth error {measures['depth_mae_mm']:.3f} mm, {100 * measures['depth_relative']:.2f} %")
    print(f"{'':13} {measures['pixels']} pixels with truth, {100 * measures['coverage']:.1f} % answered")
