"""``endosdk batch``: depth of every stereo pair of an archive, from folders to a folder."""

from __future__ import annotations

import argparse
from pathlib import Path


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("left", type=Path, help="folder of the left views")
    parser.add_argument("right", type=Path, help="folder of the right views, with the same numbers in their names")
    parser.add_argument("--out", type=Path, required=True, help="folder for the maps; a batch begun there is continued")
    parser.add_argument("--model", default="fast", help="shipped name or .onnx file (default: %(default)s)")
    parser.add_argument("--calibration", type=Path, help="rig file; without it the pairs must be rectified already")
    parser.add_argument(
        "--network-size", metavar="WxH", help="size the network works at (default: what the model is made for)"
    )
    parser.add_argument("--provider", default="cpu", help="cpu, cuda, tensorrt (default: %(default)s)")
    parser.add_argument("--threads", type=int, help="processor threads of each worker (default: all; 1 of several)")
    parser.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--ray", action="store_true", help="work on the Ray cluster of $RAY_ADDRESS, or a local one")


def run(args: argparse.Namespace) -> int:
    """Compute what is missing; the status is 1 where pictures could not be used."""
    from endosdk import StereoCalibration
    from endosdk.commands.sizes import parse_size
    from endosdk.jobs.batch import PAIRS, Settings, find_pairs, run_batch

    settings = Settings(
        model=args.model,
        calibration=StereoCalibration.load(args.calibration) if args.calibration else None,
        network_size=parse_size(args.network_size) if args.network_size else None,
        provider=args.provider,
        threads=1 if args.threads is None and (args.ray or args.workers > 1) else args.threads,
    )
    pairs = find_pairs(args.left, args.right)
    try:
        record = run_batch(pairs, settings, args.out, workers=args.workers, ray=args.ray)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; the same command continues {args.out}") from None
    model = record["settings"]["model"]
    print(f"model      {model['name']} {model['version']}")
    print("pairs      " + ", ".join(f"{count} {status}" for status, count in sorted(record["status"].items())))
    for name, error in record["failed"].items():
        print(f"FAILED     {name}: {error}")
    print(f"written    {args.out / PAIRS}")
    return 1 if record["failed"] else 0
