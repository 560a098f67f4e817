"""The pictures of a board, from folders, a video or a camera, as views to calibrate from."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import parse_size
from endosdk.commands.report import Report
from endosdk.commands.sources import add_reading, opened_source
from endosdk.errors import EndoError, InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.board import BoardCalibration
    from endosdk.calibration.board_page import LeftOut
    from endosdk.calibration.boards import Board, BoardView
    from endosdk.calibration.view_collector import ViewCollector

# What folders have no use for, and its value when it is not given.
OF_STREAMS: dict[str, object] = {
    "layout": "side-by-side", "queue": "auto", "scan": "auto", "rate": None, "raw": None, "gap": 0, "views": 20,
}  # fmt: skip
PATTERN_RULE = "must be COLUMNSxROWS of inner corners, such as 14x10"


def add_board(parser: argparse.ArgumentParser) -> None:
    """Declare the board and where its pictures come from."""
    parser.add_argument(
        "source",
        nargs="+",
        help="LEFT_DIR RIGHT_DIR: two folders, paired by the numbers in the file names. Or one source as in "
        "`endosdk view`: a video, /dev/videoN, LEFT,RIGHT, - (standard input)",
    )
    add_shape(parser)
    add_reading(parser)
    parser.add_argument("--views", type=int, default=20, help="views to take from a video or a camera")
    parser.add_argument("--page", type=Path, metavar="FILE.html", help="report to write (default: none)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        required=True,
        help="rig file: .json or .yaml; .opencv.yaml, .ros.yaml or .kalibr.yaml for other programs",
    )


def add_shape(parser: argparse.ArgumentParser) -> None:
    """Declare what the board looks like."""
    parser.add_argument(
        "--pattern", metavar="CxR", required=True, help="columns x rows of inner corners, such as 14x10"
    )
    parser.add_argument("--square-mm", type=float, metavar="MM", required=True, help="side of one square in mm")
    parser.add_argument(
        "--charuco", type=float, metavar="MM", help="side of a marker in mm (default: none, the board is a chessboard)"
    )
    parser.add_argument("--dictionary", default="4X4_50", help="OpenCV name of the marker dictionary")


def named_board(args: argparse.Namespace) -> Board:
    """Return the board that `add_shape` declared."""
    from endosdk.calibration.boards import Board

    return Board(parse_size(args.pattern, "pattern", PATTERN_RULE), args.square_mm, args.charuco, args.dictionary)


def calibrate_pictures(args: argparse.Namespace, report: Report) -> tuple[BoardCalibration, list[LeftOut]]:
    """Return the calibration, and the views that were left out."""
    from endosdk.calibration.board import MIN_PAIRS, TILT_ADVICE, are_tilted, calibrate_views
    from endosdk.calibration.board_page import LeftOut
    from endosdk.live.sources.words import two_folders

    board = named_board(args)
    if args.views < MIN_PAIRS:
        raise InvalidArgument("views", f"must be at least {MIN_PAIRS}", args.views)
    if len(args.source) > 2:
        raise InvalidArgument("source", "must be one source, or two folders", args.source)
    folders = two_folders(args.source[0]) if len(args.source) == 1 else (Path(args.source[0]), Path(args.source[1]))
    if folders:
        for name, usual in OF_STREAMS.items():
            if getattr(args, name) != usual:
                raise InvalidArgument(name, "is of a video or a camera; leave it out with folders", getattr(args, name))
    views, size, left_out = (
        _from_folders(folders, board, args.bits, args.swap) if folders else _from_source(args, board)
    )
    _say_left_out(left_out)
    result = calibrate_views(views, size)
    if folders and not are_tilted(views):  # of a film it is said meanwhile
        print(f"advice      {TILT_ADVICE}", file=sys.stderr)
    refused = [LeftOut(name, reason) for name, reason in result.refused.items()]
    _say_left_out(refused)
    left_out += refused
    report.record["skipped"] = [one._asdict() for one in left_out]
    return result, left_out


def _say_left_out(views: list[LeftOut]) -> None:
    for one in views:
        print(f"left out    {one.name}: {one.reason}", file=sys.stderr)


def _from_folders(
    folders: tuple[Path, Path], board: Board, bits: int | None, swap: bool
) -> tuple[list[BoardView], tuple[int, int], list[LeftOut]]:
    """Look at every pair of two folders. One that cannot be used is named and left out."""
    from endosdk.calibration.board_page import LeftOut
    from endosdk.calibration.boards import find_view
    from endosdk.io.picture_pairs import pair_pictures
    from endosdk.io.pictures import read_frame
    from endosdk.io.progress import progress

    views: list[BoardView] = []
    left_out: list[LeftOut] = []
    size: tuple[int, int] | None = None
    for paths in progress(pair_pictures(*folders)):
        name = f"{paths[0].name}, {paths[1].name}"
        try:
            left, right = (read_frame(path, bits=bits) for path in (paths[::-1] if swap else paths))
        except InvalidArgument as error:
            left_out.append(LeftOut(name, str(error)))
            continue
        sizes = [(picture.shape[1], picture.shape[0]) for picture in (left, right)]
        size = size or sizes[0]
        if any(one != size for one in sizes):
            reason = f"the sizes are {sizes[0]} and {sizes[1]}; the first image has {size}"
            left_out.append(LeftOut(name, reason))
            continue
        view = find_view(board, name, left, right)
        if isinstance(view, str):
            left_out.append(LeftOut(name, view))
        else:
            views.append(view)
    return views, size or (0, 0), left_out


def _from_source(args: argparse.Namespace, board: Board) -> tuple[list[BoardView], tuple[int, int], list[LeftOut]]:
    """Take views from a video or a camera until they suffice, and say meanwhile what to show next.

    Ctrl-C ends it with the views taken so far.
    """
    from endosdk.calibration.board_page import LeftOut
    from endosdk.calibration.view_collector import ViewCollector

    collector: ViewCollector | None = None
    causes: Counter[str] = Counter()
    guide = Guide()
    with opened_source(args, args.source[0]) as source:
        try:
            for frame in source:
                if collector is None:
                    collector = ViewCollector(board, (frame.left.shape[1], frame.left.shape[0]), args.views)
                offer = collector.offer(f"frame {frame.number}", frame.left, frame.right)
                if not offer.taken:
                    causes[offer.reason.split(":")[0]] += 1
                guide.show(collector, offer.reason)
                if collector.done:
                    break
        except KeyboardInterrupt:
            print("stopped; calibrating with the views so far", file=sys.stderr)
        except EndoError as error:
            if collector is None or not collector.views:
                raise
            print(f"the source ended: {error}", file=sys.stderr)
        finally:
            guide.end()
    if collector is None:
        raise InvalidArgument("source", "must hold frames", args.source[0])
    if advice := collector.advice():
        print(f"advice      {advice}", file=sys.stderr)
    left_out = [LeftOut(f"{count} frames", cause, count) for cause, count in causes.items()]
    return collector.views, collector.size, left_out


class Guide:
    """What to do next, in one line that is drawn anew, with a map of where corners were; quiet in a pipe."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()

    def show(self, collector: ViewCollector, reason: str) -> None:
        """Draw the line: the coverage map row by row, how many views there are, and the latest frame's verdict."""
        if not self._shown:
            return
        from endosdk.calibration.view_collector import coverage

        rows = coverage(collector.views, collector.size)
        drawn = "/".join("".join("#" if count else "." for count in row) for row in rows)
        text = f"[{drawn}] {len(collector.views)}/{collector.wanted} views  {reason}"
        print(f"\r{text[:118]:<118}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the line."""
        if self._shown:
            print(file=sys.stderr)
