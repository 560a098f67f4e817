"""What the verbs that read a source have in common: its options, and how it is opened."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, get_args

from endosdk.commands.options import add_bits
from endosdk.live.sources.source import Layout, Queue, Scan

if TYPE_CHECKING:
    from endosdk.live.sources.source import Source


def add_source(parser: argparse.ArgumentParser) -> None:
    """Declare the source and how it is read."""
    parser.add_argument(
        "source",
        help="folder with left and right, or with NAME_left and NAME_right images; LEFT,RIGHT (folders or videos), "
        "a video, /dev/videoN, - (standard input), a recording, a ROS bag",
    )
    add_reading(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Declare how a source is read."""
    parser.add_argument(
        "--layout", choices=get_args(Layout), default="side-by-side", help="arrangement of the two views in one image"
    )
    parser.add_argument(
        "--queue", choices=get_args(Queue), default="auto", help="auto: every frame of a file, the newest of a camera"
    )
    parser.add_argument(
        "--scan", choices=get_args(Scan), default="auto", help="auto: deinterlace frames flagged as interlaced"
    )
    parser.add_argument("--rate", type=float, help="frames per second, if the source has no time stamps (default: 25)")
    parser.add_argument(
        "--raw",
        metavar="FORMAT:WxH",
        help="raw pixel format on standard input, such as uyvy422:1920x1080 (default: Y4M)",
    )
    add_bits(parser)
    parser.add_argument("--swap", action="store_true", help="exchange the views: the right eye comes first")
    parser.add_argument("--gap", type=int, default=0, help="columns or rows between the two views in one image, px")


def add_temporal(parser: argparse.ArgumentParser) -> None:
    """Declare the filter over frames."""
    parser.add_argument("--temporal", action="store_true", help="temporal filter: reduce flicker between frames")


def opened_source(args: argparse.Namespace, word: str | None = None) -> Source:
    """Open the source that the arguments name, or ``word`` as they say."""
    from endosdk import open_source

    name = args.source if word is None else word
    reading = ("layout", "queue", "scan", "rate", "raw", "bits", "swap", "gap")
    return open_source(name, **{option: getattr(args, option) for option in reading})
