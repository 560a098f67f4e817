"""``endosdk calibrate``: turn a calibration of any layout, or pictures of a chessboard, into an endosdk rig file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import parse_size
from endosdk.commands.report import Report
from endosdk.errors import InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.board import Points
    from endosdk.calibration.rig import StereoCalibration


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the two ways to a rig file."""
    sources = parser.add_subparsers(dest="source", metavar="SOURCE", required=True)
    convert = sources.add_parser("convert", help="read a calibration file, folder or (left, right) pair of files")
    convert.add_argument("path", type=Path, nargs="+", help="OpenCV, ROS pair, Kalibr, text folder, or endosdk JSON")
    convert.add_argument(
        "--size", metavar="WxH", help="picture size, where the layout holds none (default: what the file says)"
    )
    convert.add_argument("--layout", help="name of the layout (default: recognised from the content)")
    convert.add_argument("--units", help="mm, cm or m (default: the unit of the layout)")
    convert.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="rig file to write, .json or .yaml (default: none, the summary is printed only)",
    )
    board = sources.add_parser("board", help="calibrate from pictures of a chessboard")
    board.add_argument("left", type=Path, help="folder of left pictures")
    board.add_argument("right", type=Path, help="folder of right pictures; the numbers in the names make the pairs")
    board.add_argument("--pattern", metavar="CxR", required=True, help="columns x rows of inner corners, such as 14x10")
    board.add_argument("--square-mm", type=float, metavar="MM", required=True, help="side of one square in mm")
    board.add_argument("--out", type=Path, metavar="FILE", required=True, help="rig file to write, .json or .yaml")


def run(args: argparse.Namespace) -> int:
    """Run the chosen way; print what was found and where it went."""
    report = Report(args)
    calibration = _convert(args) if args.source == "convert" else _board(args, report)
    _report_summary(report, calibration)
    if args.out:
        calibration.save(args.out)
        report.record["written"] = args.out
        report.line(f"written     {args.out}")
    return report.end()


def _convert(args: argparse.Namespace) -> StereoCalibration:
    from endosdk.calibration.rig import StereoCalibration

    path = args.path[0] if len(args.path) == 1 else args.path
    size = parse_size(args.size) if args.size else None
    return StereoCalibration.load(path, size=size, layout=args.layout, units=args.units)


def _board(args: argparse.Namespace, report: Report) -> StereoCalibration:
    from endosdk.calibration.board import calibrate_board
    from endosdk.io.picture_pairs import pair_pictures

    pattern = parse_size(args.pattern, "pattern", "must be COLUMNSxROWS of inner corners, such as 14x10")
    left, right, size = _find_all(report, pair_pictures(args.left, args.right), pattern)
    result = calibrate_board(left, right, pattern, args.square_mm, size)
    median, p95 = result.row_median_px, result.row_p95_px
    report.record |= {"pairs_used": len(left), "reprojection_px": result.reprojection_px}
    report.record["vertical_disparity_px"] = {"median": median, "p95": p95}
    report.line(f"pairs       {len(left)} used")
    report.line(f"reprojected {result.reprojection_px:.3f} px (root mean square)")
    report.line(f"rows        differ by {median:.3f} px (median), {p95:.3f} px (95th percentile)")
    return result.calibration


def _find_all(
    report: Report, pairs: list[tuple[Path, Path]], pattern: tuple[int, int]
) -> tuple[list[Points], list[Points], tuple[int, int]]:
    """Return the corners of every pair in which both views show the whole board, and the size of the pictures.

    A pair of which a picture cannot be read, or does not show the whole board, is named and left out.
    """
    from endosdk.calibration.board import find_corners, same_order
    from endosdk.io.pictures import read_frame
    from endosdk.jobs.progress import progress

    left: list[Points] = []
    right: list[Points] = []
    size: tuple[int, int] | None = None
    skipped: dict[str, str] = {}
    report.record["skipped"] = skipped
    for paths in progress(pairs):
        name = f"{paths[0].name}, {paths[1].name}"
        try:
            pictures = [read_frame(path) for path in paths]
        except InvalidArgument as error:
            skipped[name] = str(error)
            continue
        for path, picture in zip(paths, pictures, strict=True):
            size = size or (picture.shape[1], picture.shape[0])
            if (picture.shape[1], picture.shape[0]) != size:
                raise InvalidArgument("pictures", f"must all have the size {size}", f"{path} {picture.shape[1::-1]}")
        found = [find_corners(picture, pattern) for picture in pictures]
        if found[0] is None or found[1] is None:
            skipped[name] = "no whole board in both views"
            continue
        left.append(found[0])
        right.append(same_order(found[0], found[1]))
    for name, cause in skipped.items():
        print(f"left out    {name}: {cause}", file=sys.stderr)
    return left, right, size or (0, 0)


def _report_summary(report: Report, calibration: StereoCalibration) -> None:
    import numpy as np

    geometry = calibration.rectification()
    cosine = (np.trace(calibration.rotation) - 1) / 2
    degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    left, right = calibration.left_matrix, calibration.right_matrix
    report.line(f"pictures    {calibration.width}x{calibration.height}, {calibration.model} model")
    for side, camera in (("left", left), ("right", right)):
        centre = f"({camera[0, 2]:.1f}, {camera[1, 2]:.1f})"
        report.line(f"{side:11} focal {camera[0, 0]:.1f} x {camera[1, 1]:.1f} px, principal point {centre}")
    report.line(f"baseline    {calibration.baseline_mm:.3f} mm, cameras turned by {degrees:.2f} degrees")
    state = "already rectified" if calibration.is_rectified else "to be rectified"
    report.line(f"rectified   {geometry.width}x{geometry.height}, focal {geometry.focal_px:.1f} px, {state}")
    report.line(f"sha256      {calibration.sha256}")
    report.record["calibration"] = {**calibration.content(), "sha256": calibration.sha256}
    report.record["baseline_mm"] = calibration.baseline_mm
    report.record["rectified"] = {
        **{name: getattr(geometry, name) for name in ("width", "height", "focal_px", "cx", "cy", "doffs")},
        "already": calibration.is_rectified,
    }
