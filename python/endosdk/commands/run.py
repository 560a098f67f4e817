"""``endosdk run``: depth of a whole video, recorded."""

from __future__ import annotations

import argparse
from pathlib import Path

from endosdk.commands.report import Report
from endosdk.commands.sources import add_estimator, add_source, made_estimator, opened_source


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_source(parser)
    add_estimator(parser)
    parser.add_argument(
        "--out", type=Path, required=True, help="folder, FILE.mkv, FILE.mcap or FILE.bag; what was begun there goes on"
    )
    parser.add_argument("--no-pictures", action="store_true", help="keep depth alone: replay then has no frames")
    parser.add_argument("--frames", type=int, help="stop after so many (default: at the end of the source)")


def run(args: argparse.Namespace) -> int:
    """Record; the status is 1 where every frame was INVALID, or there was none."""
    from endosdk.live.recording.record import record

    with opened_source(args) as source:
        try:
            told = record(source, made_estimator(args), args.out, pictures=not args.no_pictures, most=args.frames)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"stopped; the same command continues {args.out}") from None
    report = Report(args)
    report.record = {**told, "out": args.out}
    counts = ", ".join(f"{count} {status}" for status, count in sorted(told["status"].items()))
    report.line(f"frames     {told['frames']}: {counts or 'none'}")
    if told["dropped"]:
        report.line(f"dropped    {told['dropped']}")
    for fault in told["faults"][:10]:
        report.line(f"FAULT      {fault}")
    report.line(f"written    {args.out}")
    return report.end(usable=bool(set(told["status"]) - {"INVALID"}))
