"""What the verbs that read a source have in common: its options, and the estimator that looks at it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from endosdk.live.sources.base import Layout, Queue, Scan

if TYPE_CHECKING:
    from endosdk.live.sources.base import Source
    from endosdk.runtime.estimator import DepthEstimator


def add_source(parser: argparse.ArgumentParser) -> None:
    """Declare the source and how it is read."""
    parser.add_argument(
        "source",
        help="folder with left and right, LEFT,RIGHT (folders or videos), a video, /dev/videoN, - (standard input), "
        "a recording, a ROS bag",
    )
    parser.add_argument(
        "--layout", choices=get_args(Layout), default="side-by-side", help="two views in one picture (%(default)s)"
    )
    parser.add_argument(
        "--queue", choices=get_args(Queue), default="auto", help="auto: every frame of a file, the newest of a camera"
    )
    parser.add_argument(
        "--scan", choices=get_args(Scan), default="auto", help="auto: deinterlace what says it is interlaced"
    )
    parser.add_argument("--rate", type=float, help="frames a second, where the source has no time stamps (25)")
    parser.add_argument("--raw", metavar="FORMAT:WxH", help="bare pixels on standard input: uyvy422:1920x1080")


def add_estimator(parser: argparse.ArgumentParser) -> None:
    """Declare the model and the rig."""
    parser.add_argument("--model", default="fast", help="shipped name or .onnx file (default: %(default)s)")
    parser.add_argument("--calibration", type=Path, help="rig file; without it the views must be rectified already")
    parser.add_argument("--network-size", metavar="WxH", help="size the network works at (default: the model's)")
    parser.add_argument("--provider", default="cpu", help="cpu, cuda, tensorrt (default: %(default)s)")
    parser.add_argument("--threads", type=int, help="processor threads (default: all)")


def opened_source(args: argparse.Namespace) -> Source:
    """Open the source that the arguments name."""
    from endosdk import open_source

    return open_source(args.source, layout=args.layout, queue=args.queue, scan=args.scan, rate=args.rate, raw=args.raw)


def made_estimator(args: argparse.Namespace) -> DepthEstimator:
    """Make the estimator that the arguments describe."""
    from endosdk import DepthEstimator, StereoCalibration
    from endosdk.commands.sizes import parse_size

    return DepthEstimator(
        args.model,
        calibration=StereoCalibration.load(args.calibration) if args.calibration else None,
        provider=args.provider,
        threads=args.threads,
        network_size=parse_size(args.network_size) if args.network_size else None,
    )
