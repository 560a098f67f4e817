"""``endosdk calibrate``: turn a calibration of any layout, or pictures of a chessboard, into an endosdk rig file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.sizes import parse_size
from endosdk.errors import InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.board import Points
    from endosdk.calibration.rig import StereoCalibration


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the two ways to a rig file."""
    sources = parser.add_subparsers(dest="source", metavar="SOURCE", required=True)
    convert = sources.add_parser("convert", help="read a calibration file, folder or (left, right) pair of files")
    convert.add_argument("path", type=Path, nargs="+", help="OpenCV, ROS pair, Kalibr, text folder, or endosdk JSON")
    convert.add_argument("--size", help="picture size, such as 1920x1080, where the layout holds none")
    convert.add_argument("--layout", help="name of the layout when it is not recognised")
    convert.add_argument("--units", help="mm, cm or m, when the file is not in its layout's unit")
    convert.add_argument("--out", type=Path, help="rig file to write; without it the summary is printed only")
    board = sources.add_parser("board", help="calibrate from pictures of a chessboard")
    board.add_argument("left", type=Path, help="folder of left pictures")
    board.add_argument("right", type=Path, help="folder of right pictures; the numbers in the names make the pairs")
    board.add_argument("--pattern", required=True, help="inner corners, such as 14x10")
    board.add_argument("--square-mm", type=float, required=True, help="side of one square in mm")
    board.add_argument("--out", type=Path, required=True, help="rig file to write")


def run(args: argparse.Namespace) -> int:
    """Run the chosen way; print what was found and where it went."""
    calibration = _convert(args) if args.source == "convert" else _board(args)
    _print_summary(calibration)
    if args.out:
        calibration.save(args.out)
        print(f"written     {args.out}")
    return 0


def _convert(args: argparse.Namespace) -> StereoCalibration:
    from endosdk.calibration.rig import StereoCalibration

    path = args.path[0] if len(args.path) == 1 else args.path
    size = parse_size(args.size) if args.size else None
    return StereoCalibration.load(path, size=size, layout=args.layout, units=args.units)


def _board(args: argparse.Namespace) -> StereoCalibration:
    from endosdk.calibration.board import calibrate_board
    from endosdk.io.picture_pairs import pair_pictures

    pattern = parse_size(args.pattern)
    left, right, size = _find_all(pair_pictures(args.left, args.right), pattern)
    print("solving ...", file=sys.stderr)
    result = calibrate_board(left, right, pattern, args.square_mm, size)
    print(f"pairs       {len(left)} used")
    print(f"reprojected {result.reprojection_px:.3f} px (root mean square)")
    print(f"rows        differ by {result.row_median_px:.3f} px (median), {result.row_p95_px:.3f} px (95th percentile)")
    return result.calibration


def _find_all(
    pairs: list[tuple[Path, Path]], pattern: tuple[int, int]
) -> tuple[list[Points], list[Points], tuple[int, int]]:
    """Return the corners of every pair in which both views show the whole board, and the size of the pictures."""
    from endosdk.calibration.board import find_corners, same_order
    from endosdk.io.pictures import read_frame

    left: list[Points] = []
    right: list[Points] = []
    size: tuple[int, int] | None = None
    for number, paths in enumerate(pairs, 1):
        print(f"pair {number} of {len(pairs)}: {paths[0].name}, {paths[1].name}", end="", file=sys.stderr, flush=True)
        pictures = [read_frame(path) for path in paths]
        for path, picture in zip(paths, pictures, strict=True):
            size = size or (picture.shape[1], picture.shape[0])
            if (picture.shape[1], picture.shape[0]) != size:
                raise InvalidArgument("pictures", f"must all have the size {size}", f"{path} {picture.shape[1::-1]}")
        found = [find_corners(picture, pattern) for picture in pictures]
        if found[0] is None or found[1] is None:
            print(": no whole board, skipped", file=sys.stderr)
            continue
        print(": found", file=sys.stderr)
        left.append(found[0])
        right.append(same_order(found[0], found[1]))
    return left, right, size or (0, 0)


def _print_summary(calibration: StereoCalibration) -> None:
    import numpy as np

    geometry = calibration.rectification()
    cosine = (np.trace(calibration.rotation) - 1) / 2
    degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    left, right = calibration.left_matrix, calibration.right_matrix
    print(f"pictures    {calibration.width}x{calibration.height}, {calibration.model} model")
    for side, camera in (("left", left), ("right", right)):
        centre = f"({camera[0, 2]:.1f}, {camera[1, 2]:.1f})"
        print(f"{side:11} focal {camera[0, 0]:.1f} x {camera[1, 1]:.1f} px, principal point {centre}")
    print(f"baseline    {calibration.baseline_mm:.3f} mm, cameras turned by {degrees:.2f} degrees")
    state = "already rectified" if calibration.is_rectified else "to be rectified"
    print(f"rectified   {geometry.width}x{geometry.height}, focal {geometry.focal_px:.1f} px, {state}")
    print(f"sha256      {calibration.sha256}")
