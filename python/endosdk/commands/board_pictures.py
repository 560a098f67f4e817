"""The pictures of a board, from folders, a video or a camera, as views to calibrate from."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import parse_size
from endosdk.commands.report import Report
from endosdk.commands.sources import add_reading, opened_source
from endosdk.errors import EndoError, InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.board import BoardCalibration
    from endosdk.calibration.boards import Board, BoardView
    from endosdk.calibration.view_collector import ViewCollector

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


def calibrate_pictures(args: argparse.Namespace, report: Report) -> tuple[BoardCalibration, dict[str, str]]:
    """Return the calibration, and why views were left out."""
    from endosdk.calibration.board import calibrate_views
    from endosdk.live.sources.words import two_folders

    board = named_board(args)
    if len(args.source) > 2:
        raise InvalidArgument("source", "must be one source, or two folders", args.source)
    folders = two_folders(args.source[0]) if len(args.source) == 1 else (Path(args.source[0]), Path(args.source[1]))
    views, size, left_out = _from_folders(folders, board) if folders else _from_source(args, board)
    _say_left_out(left_out)
    result = calibrate_views(views, size)
    _say_left_out(result.refused)
    report.record["skipped"] = {**left_out, **result.refused}
    return result, left_out


def _say_left_out(reasons: dict[str, str]) -> None:
    for name, cause in reasons.items():
        print(f"left out    {name}: {cause}", file=sys.stderr)


def _from_folders(folders: tuple[Path, Path], board: Board) -> tuple[list[BoardView], tuple[int, int], dict[str, str]]:
    """Look at every pair of two folders. One that cannot be used is named and left out."""
    from endosdk.calibration.boards import find_view
    from endosdk.io.picture_pairs import pair_pictures
    from endosdk.io.pictures import read_frame
    from endosdk.io.progress import progress

    views: list[BoardView] = []
    left_out: dict[str, str] = {}
    size: tuple[int, int] | None = None
    for paths in progress(pair_pictures(*folders)):
        name = f"{paths[0].name}, {paths[1].name}"
        try:
            left, right = (read_frame(path) for path in paths)
        except InvalidArgument as error:
            left_out[name] = str(error)
            continue
        sizes = [(picture.shape[1], picture.shape[0]) for picture in (left, right)]
        size = size or sizes[0]
        if any(one != size for one in sizes):
            left_out[name] = f"the sizes are {sizes[0]} and {sizes[1]}; the first image has {size}"
            continue
        view = find_view(board, name, left, right)
        if isinstance(view, str):
            left_out[name] = view
        else:
            views.append(view)
    return views, size or (0, 0), left_out


def _from_source(args: argparse.Namespace, board: Board) -> tuple[list[BoardView], tuple[int, int], dict[str, str]]:
    """Take views from a video or a camera until they suffice, and say meanwhile what to show next.

    Ctrl-C ends it with the views taken so far.
    """
    from endosdk.calibration.view_collector import ViewCollector

    collector: ViewCollector | None = None
    causes: dict[str, int] = {}
    guide = Guide()
    with opened_source(args, args.source[0]) as source:
        try:
            for frame in source:
                if collector is None:
                    collector = ViewCollector(board, (frame.left.shape[1], frame.left.shape[0]), args.views)
                offer = collector.offer(f"frame {frame.number}", frame.left, frame.right)
                if not offer.taken:
                    cause = offer.reason.split(":")[0]
                    causes[cause] = causes.get(cause, 0) + 1
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
    return collector.views, collector.size, {f"{count} frames": cause for cause, count in causes.items()}


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
