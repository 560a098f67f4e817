"""``endosdk run``: depth of a whole video, recorded."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import add_estimator, made_estimator
from endosdk.commands.report import Report
from endosdk.commands.sources import add_source, add_temporal, opened_source

if TYPE_CHECKING:
    from endosdk.live.sources.source import Source


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_source(parser)
    add_estimator(parser)
    add_temporal(parser)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help="folder, FILE.mkv, FILE.mcap, FILE.bag or FOLDER.ros2; an unfinished recording is continued",
    )
    parser.add_argument(
        "--no-pictures", action="store_true", help="do not record camera images; replay then gives depth only"
    )
    parser.add_argument(
        "--frames", type=int, help="stop after this number of frames (default: at the end of the source)"
    )


def run(args: argparse.Namespace) -> int:
    """Record; the status is 1 where every frame was INVALID, or there was none."""
    from endosdk.errors import DependencyMissing, SourceFailed, StorageFailed
    from endosdk.live.recording.record import record

    with opened_source(args) as source:
        try:
            summary = record(
                source,
                made_estimator(args),
                args.out,
                pictures=not args.no_pictures,
                most=args.frames,
                temporal=args.temporal,
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"stopped; {_what_stays(source, args.out)}") from None
        except (DependencyMissing, SourceFailed, StorageFailed):
            print(_what_stays(source, args.out), file=sys.stderr)
            raise
    report = Report(args)
    report.record = {**summary, "out": args.out}
    counts = ", ".join(f"{count} {status}" for status, count in sorted(summary["status"].items()))
    report.line(f"frames     {summary['frames']}: {counts or 'none'}")
    report.causes(summary["causes"], "frames")
    if summary["dropped"]:
        report.line(f"dropped    {summary['dropped']}")
    for fault in summary["faults"][:10]:
        report.line(f"FAULT      {fault}")
    if len(summary["faults"]) > 10:
        report.line(f"FAULT      and {len(summary['faults']) - 10} more")
    report.line(f"written    {args.out}")
    return report.end(usable=bool(set(summary["status"]) - {"INVALID"}))


def _what_stays(source: Source, out: Path) -> str:
    """Say what there is of a recording that did not come to its end, and who goes on with it."""
    from endosdk.live.recording.record import begun

    folder, frames = begun(out)
    if not frames:
        return "no frame was recorded"
    if source.once:
        return f"{frames} frames stay in {folder}: endosdk replay reads them"
    return f"{frames} frames stay in {folder}: endosdk replay reads them, the same command continues {out}"
