"""``endosdk batch``: depth of every stereo pair of an archive, from folders to a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from endosdk.commands.options import (
    add_bits,
    add_calibration,
    add_limits,
    add_model,
    add_processes,
    add_session,
    limit_options,
    session_options,
)
from endosdk.commands.report import Report


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("left", help="folder of left images; or one folder with both sides; or LEFT,RIGHT")
    parser.add_argument("right", nargs="?", help="folder of right images, with the same numbers in their names")
    parser.add_argument("--out", type=Path, required=True, help="output folder; an unfinished batch is continued")
    add_model(parser)
    add_calibration(parser)
    add_session(parser, all_threads="all cores, at most 8; 1 in each of several workers")
    add_limits(parser)
    add_bits(parser)
    add_processes(parser)


def run(args: argparse.Namespace) -> int:
    """Compute what is missing; the status is 1 where pictures, or the maps of a pair, cannot be used."""
    from endosdk import StereoCalibration
    from endosdk.errors import InvalidArgument
    from endosdk.jobs.batch import PAIRS, Settings, find_pairs, run_batch
    from endosdk.live.sources.words import two_folders
    from endosdk.runtime.limits import Limits

    options = session_options(args)
    if args.threads is None and (args.ray or args.workers > 1):
        options["threads"] = 1
    rig = StereoCalibration.load(args.calibration) if args.calibration else None
    limits = Limits(**limit_options(args))
    settings = Settings(model=args.model, calibration=rig, limits=limits, bits=args.bits, **options)
    folders = two_folders(args.left) if args.right is None else (Path(args.left), Path(args.right))
    if folders is None:
        raise InvalidArgument("source", "must be LEFT,RIGHT, two folders, or a folder with left and right", args.left)
    pairs = find_pairs(*folders)
    try:
        record = run_batch(pairs, settings, args.out, workers=args.workers, ray=args.ray)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; the same command continues {args.out}") from None
    report = Report(args)
    report.record = {**record, "out": args.out / PAIRS}
    model = record["settings"]["model"]
    report.line(f"model      {model['name']} {model['version']}")
    report.line("pairs      " + ", ".join(f"{count} {status}" for status, count in sorted(record["status"].items())))
    report.causes(record["causes"], "pairs")
    for name, error in record["failed"].items():
        report.line(f"FAILED     {name}: {error}")
    report.line(f"written    {args.out / PAIRS}")
    return report.end(usable=not record["failed"] and "INVALID" not in record["status"])
