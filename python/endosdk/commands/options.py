"""What the verbs' arguments have in common: the parser, its help, and the options that several verbs take."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from endosdk import _core
from endosdk.commands.report import Report
from endosdk.errors import InvalidArgument
from endosdk.io.pictures import BITS
from endosdk.runtime.models import shipped_weights

if TYPE_CHECKING:
    from endosdk.calibration.rig import StereoCalibration
    from endosdk.runtime.estimator import DepthEstimator


class _Help(argparse.HelpFormatter):
    """Help that shows every default, keeps paragraphs apart, and leaves an example on a line of its own."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        parts = text.split("\n\n")
        shown = (
            part if part.startswith("Example:") else super(_Help, self)._fill_text(part, width, indent)
            for part in parts
        )
        return "\n\n".join(shown)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        shown = action.default is None or isinstance(action.default, bool) or action.default == argparse.SUPPRESS
        if shown or action.help is None or "default" in action.help:
            return action.help
        return action.help + " (default: %(default)s)"


def sentence(summary: str) -> str:
    """Return the summary of a command as a sentence of its own."""
    return f"{summary[0].upper()}{summary[1:]}."


class Parser(argparse.ArgumentParser):
    """A parser that shows every default, takes no abbreviations, and prints its help when it is called bare."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **options)
        self._bare = False

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Refuse words that this command does not know, with its own usage; that of `endosdk` would not help."""
        self._bare = not (sys.argv[1:] if args is None else args)
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Print the help where nothing was given, else what is wrong."""
        if self._bare:
            self.print_help(sys.stderr)
            self.exit(2)
        super().error(message)


MODEL = "fast"  # unless another is asked for


def add_model(parser: argparse.ArgumentParser, *, others: str = "") -> None:
    """Add which model runs."""
    parser.add_argument(
        "--model",
        default=MODEL,
        help=f"name of a shipped model ({', '.join(shipped_weights())}) or a .onnx file{others}",
    )


def add_calibration(
    parser: argparse.ArgumentParser, use: str = "calibration file; without it, images must be rectified"
) -> None:
    """Add the rig of raw pairs; ``use`` says what for."""
    parser.add_argument("--calibration", type=Path, metavar="FILE", help=f"{use} (default: none)")


def known_depths(calibration: StereoCalibration) -> dict[str, float | None]:
    """Return how near a surface may come to a rig, for every shipped model; nothing without ONNX Runtime."""
    from endosdk.errors import RuntimeMissing
    from endosdk.runtime.working_distance import nearest_depths

    try:
        return nearest_depths(calibration)
    except RuntimeMissing:
        return {}


def report_nearest_depths(report: Report, calibration: StereoCalibration) -> None:
    """Say how near a surface may come to a rig, for every shipped model."""
    from endosdk.errors import RuntimeMissing
    from endosdk.runtime.working_distance import nearest_depths

    try:
        depths = nearest_depths(calibration)
    except RuntimeMissing as error:
        report.line(f"nearest     depth of the shipped models is not known: {error}")
        return
    report.record["nearest_depth_mm"] = depths
    report.line("nearest     depth of each model on this rig:")
    for name, depth in depths.items():
        report.line(f"            {name:14} {'not stated' if depth is None else f'{math.ceil(depth):5} mm'}")


def add_session(
    parser: argparse.ArgumentParser, *, threads: int | None = None, all_threads: str = "all cores, at most 8"
) -> None:
    """Add how a model runs: size, provider, threads."""
    parser.add_argument(
        "--network-size",
        metavar="WxH",
        help="network input size, such as 480x360 (default: set by the model)",
    )
    parser.add_argument("--provider", default="cpu", help=f"ONNX Runtime provider: {', '.join(_core.providers)}")
    parser.add_argument(
        "--provider-option",
        action="append",
        metavar="KEY=VALUE",
        help="provider option, passed on unchanged; repeat for several options (default: none)",
    )
    default = "" if threads is not None else f" (default: {all_threads})"
    parser.add_argument("--threads", type=int, default=threads, help=f"CPU threads{default}")


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add which answers count."""
    parser.add_argument(
        "--min-confidence",
        type=float,
        default=_core.default_min_confidence,
        help="pixels of less confidence have no depth, 0..1",
    )
    parser.add_argument(
        "--depth-range",
        metavar="NEAREST,FARTHEST",
        help="pixels nearer or farther have no depth, mm, such as 20,200; needs --calibration (default: none)",
    )


def add_bits(parser: argparse.ArgumentParser) -> None:
    """Add how image files of 16 bits are read."""
    parser.add_argument(
        "--bits", type=int, choices=BITS, help="used bits of 16-bit image files (default: files have 8 bits)"
    )


def add_processes(parser: argparse.ArgumentParser) -> None:
    """Add who does the tasks of a long job."""
    parser.add_argument("--workers", type=int, default=1, help="number of parallel processes")
    parser.add_argument("--ray", action="store_true", help="use the Ray cluster at $RAY_ADDRESS, or start a local one")


def session_options(args: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_session` added as arguments of `DepthEstimator`."""
    options = _core.parse_provider_options(args.provider_option or [])
    _core.checked_provider_options(args.provider, options)  # only here a key that stands twice is still seen
    return {
        "provider": args.provider,
        "provider_options": dict(options) or None,
        "threads": args.threads,
        "network_size": parse_size(args.network_size, "network_size") if args.network_size else None,
    }


def add_estimator(parser: argparse.ArgumentParser) -> None:
    """Add the model, the rig, and how they are used: what `made_estimator` reads."""
    add_model(parser)
    add_calibration(parser)
    add_session(parser)
    add_limits(parser)


def made_estimator(args: argparse.Namespace) -> DepthEstimator:
    """Make the estimator that the arguments describe."""
    from endosdk import DepthEstimator, StereoCalibration

    rig = StereoCalibration.load(args.calibration) if args.calibration else None
    return DepthEstimator(args.model, calibration=rig, **session_options(args), **limit_options(args))


def limit_options(args: argparse.Namespace) -> dict[str, Any]:
    """Return what `add_limits` added as arguments of `DepthEstimator`."""
    options: dict[str, Any] = {"min_confidence": args.min_confidence}
    if args.depth_range is not None:
        options["depth_range_mm"] = parse_depth_range(args.depth_range)
    return options


def parse_depth_range(text: str) -> tuple[float, float]:
    """Turn ``NEAREST,FARTHEST`` into a pair; the estimator checks what the numbers say."""
    try:
        nearest, farthest = (float(part) for part in text.split(","))
    except ValueError:
        rule = "must be NEAREST,FARTHEST in mm, such as 20,200"
        raise InvalidArgument("depth_range_mm", rule, repr(text)) from None
    return nearest, farthest


def parse_size(
    text: str, name: str = "size", rule: str = "must be WIDTHxHEIGHT in whole pixels, such as 960x720"
) -> tuple[int, int]:
    """Turn ``WIDTHxHEIGHT``, or any two such numbers, into a pair."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InvalidArgument(name, rule, repr(text))
    return int(parts[0]), int(parts[1])
