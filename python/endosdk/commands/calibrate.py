"""``endosdk calibrate``: rig files from other layouts or a chessboard, checked and corrected by frames of tissue."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from endosdk.commands.board_pictures import add_board, add_shape, calibrate_pictures, named_board
from endosdk.commands.options import add_model, known_depths, parse_size, report_nearest_depths, sentence
from endosdk.commands.report import Report
from endosdk.commands.sources import add_source, opened_source
from endosdk.errors import InvalidArgument

if TYPE_CHECKING:
    from endosdk.calibration.board import BoardCalibration
    from endosdk.calibration.board_page import LeftOut
    from endosdk.calibration.rig import StereoCalibration
    from endosdk.live.rig_check import RigCheck


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the ways to a rig file."""
    from endosdk.calibration.files import LAYOUTS

    sources = parser.add_subparsers(dest="way", metavar="ACTION", required=True)
    convert = _way(sources, "convert", "print a calibration file and convert it to another format")
    convert.add_argument(
        "path",
        type=Path,
        nargs="+",
        help="one calibration file or folder, or two files: left and right, or cameras and extrinsics",
    )
    convert.add_argument("--size", metavar="WxH", help="image size, if the file has none (default: that of the file)")
    convert.add_argument("--layout", help=f"file format: {', '.join(LAYOUTS)} (default: detected from the content)")
    convert.add_argument("--units", help="mm, cm or m (default: the unit of the format)")
    convert.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="rig file to write: .json or .yaml; .opencv.yaml, .ros.yaml or .kalibr.yaml for other programs (default: "
        "none, the summary is printed only)",
    )
    board = _way(sources, "board", "calibrate from images of a chessboard or a ChArUco board")
    add_board(board)

    printed = _way(sources, "print", "write a board as an image that prints in its true size")
    add_shape(printed)
    printed.add_argument("--out", type=Path, metavar="FILE.png", required=True, help="image file to write")

    check = _way(sources, "check", "check from tissue images whether a calibration is still valid")
    refine = _way(sources, "refine", "correct the camera rotation in a calibration from tissue images")
    for parser_of_frames in (check, refine):
        parser_of_frames.add_argument("rig", type=Path, help="rig file")
        add_source(parser_of_frames)
        add_model(parser_of_frames)
        parser_of_frames.add_argument("--frames", type=int, default=60, help="number of frames to use, from the first")
    refine.add_argument("--out", type=Path, metavar="FILE", required=True, help="rig file to write, .json or .yaml")


def _way(sources: Any, name: str, summary: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = sources.add_parser(name, help=summary, description=sentence(summary))
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the chosen way; print what was found and where it went."""
    from endosdk.calibration.files.exports import check_name
    from endosdk.io.new_folders import made_folder

    report = Report(args)
    # Before the work, which may be a long one.
    if args.way != "print" and getattr(args, "out", None):
        check_name("out", args.out)
    for name in ("out", "page"):
        if getattr(args, name, None):
            made_folder(getattr(args, name).parent, name)
    if args.way in ("check", "refine"):
        return _watch(args, report)
    if args.way == "print":
        return _print(args, report)
    if args.way == "convert":
        calibration = _convert(args)
        written = calibration.save(args.out) if args.out else []
    else:
        result, left_out = calibrate_pictures(args, report)
        calibration = result.calibration
        written = calibration.save(args.out) if args.out else []  # first: what follows can fail
        _report_board(args, report, result, left_out)
    _report_summary(report, calibration)
    _report_written(report, written)
    return report.end()


def _report_written(report: Report, written: list[Path]) -> None:
    if written:
        report.record["written"] = written[0] if len(written) == 1 else written
        report.line(f"written     {', '.join(str(path) for path in written)}")


def _print(args: argparse.Namespace, report: Report) -> int:
    from endosdk.calibration.board_print import print_board

    if args.out.suffix.lower() != ".png":
        raise InvalidArgument("out", "must be a file that ends in .png", args.out)
    width, height = print_board(args.out, named_board(args))
    report.record |= {"written": args.out, "width_mm": width, "height_mm": height}
    report.line(f"written     {args.out}, {width:.0f} x {height:.0f} mm")
    report.line("            print it at 100 %, then measure ten squares")
    return report.end()


def _watch(args: argparse.Namespace, report: Report) -> int:
    """Check or correct a rig; the status is 1 where the rig does not fit, or too little could be measured."""
    from itertools import islice

    from endosdk.calibration.rig import StereoCalibration
    from endosdk.io.progress import progress
    from endosdk.live.rig_check import check_rig, refine_rig

    if args.frames < 1:
        raise InvalidArgument("frames", "must be at least 1", args.frames)
    calibration = StereoCalibration.load(args.rig)
    with opened_source(args) as source:
        seen = islice(source, args.frames)
        if args.way == "check":  # one frame at a time: sixty are gigabytes
            found = check_rig(calibration, progress(seen, total=args.frames), args.model)
            _report_check(report, "found", found)
            return report.end(usable=found.fits)
        frames = list(seen)
    refined, before, after = refine_rig(calibration, frames, args.model)
    _report_check(report, "before", before)
    _report_check(report, "after", after)
    if not after.lenses_fit:
        report.line("unchanged   no rotation makes the views fit: nothing was written")
        return report.end(usable=False)
    if refined is calibration:
        report.line("unchanged   the frames show no rotation that a correction would make smaller: nothing was written")
        return report.end(usable=before.fits)
    report.record["sha256"] = refined.sha256
    _report_written(report, refined.save(args.out))
    return report.end(usable=after.fits)


def _report_check(report: Report, name: str, check: RigCheck) -> None:
    from dataclasses import asdict

    report.record[name] = asdict(check)
    report.line(f"{name:11} {check.measured} of {check.frames} frames measured")
    if not check.measured:
        report.line("            too little texture, or views of different scenes: the rig could not be measured")
        return
    report.line(f"            vertical disparity {check.vertical_disparity_px:.2f} px (median over the frames)")
    for axis, angle, error in zip(("x", "y", "z"), check.rotation_deg, check.rotation_se_deg, strict=True):
        report.line(
            f"            right camera rotated about {axis} by {angle:+.3f} degrees, standard error {error:.3f}"
        )
    if check.fits:
        verdict = "the rig fits its calibration"
    elif not check.lenses_fit:
        verdict = "in most frames, lens or scale is not what the calibration states: calibrate again"
    elif check.drifted:
        verdict = "the rig has moved since its calibration: run endosdk calibrate refine, or calibrate again"
    else:
        verdict = "the rows of most frames differ: calibrate again"
    report.line(f"            {verdict}")
    for cause, count in sorted(check.causes.items()):
        report.line(f"            {cause} in {count} frames")


def _convert(args: argparse.Namespace) -> StereoCalibration:
    from endosdk.calibration.rig import StereoCalibration

    path = args.path[0] if len(args.path) == 1 else args.path
    size = parse_size(args.size) if args.size else None
    return StereoCalibration.load(path, size=size, layout=args.layout, units=args.units)


def _report_board(
    args: argparse.Namespace, report: Report, result: BoardCalibration, left_out: Sequence[LeftOut]
) -> None:
    from endosdk.calibration.board_page import board_page
    from endosdk.io.whole_files import write_text

    median, p95 = result.row_median_px, result.row_p95_px
    report.record |= {"pairs_used": len(result.views), "reprojection_px": result.reprojection_px}
    report.record["vertical_disparity_px"] = {"median": median, "p95": p95}
    report.line(f"pairs       {len(result.views)} used, {sum(one.views for one in left_out)} left out")
    report.line(f"reprojected {result.reprojection_px:.3f} px (root mean square)")
    report.line(f"rows        vertical disparity {median:.3f} px (median), {p95:.3f} px (95th percentile)")
    if result.errors is not None:
        depths = result.errors.depth_mm
        report.record["view_px"] = result.view_px
        report.record["standard_errors"] = result.errors.standard_errors
        report.record["depth_error_mm"] = {f"{mm:g}": {"middle": a, "edge": b} for mm, (a, b) in depths.items()}
        said = ", ".join(f"{middle:.2f} mm at {mm:.0f} mm" for mm, (middle, _) in depths.items())
        report.line(f"depth       uncertain by {said} (one standard error, image centre)")
    if args.page:
        write_text(args.page, board_page(result, left_out, known_depths(result.calibration)))
        report.record["page"] = args.page
        report.line(f"page        {args.page}")


def _report_summary(report: Report, calibration: StereoCalibration) -> None:
    import numpy as np

    geometry = calibration.rectification()
    cosine = (np.trace(calibration.rotation) - 1) / 2
    degrees = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    left, right = calibration.left_matrix, calibration.right_matrix
    report.line(f"images      {calibration.width}x{calibration.height}, {calibration.model} model")
    for side, camera in (("left", left), ("right", right)):
        centre = f"({camera[0, 2]:.1f}, {camera[1, 2]:.1f})"
        report.line(f"{side:11} focal {camera[0, 0]:.1f} x {camera[1, 1]:.1f} px, principal point {centre}")
    report.line(f"baseline    {calibration.baseline_mm:.3f} mm, cameras rotated by {degrees:.2f} degrees")
    state = "already rectified" if calibration.is_rectified else "to be rectified"
    report.line(f"rectified   {geometry.width}x{geometry.height}, focal {geometry.focal_px:.1f} px, {state}")
    report.line(f"sha256      {calibration.sha256}")
    report_nearest_depths(report, calibration)
    report.record["calibration"] = {**calibration.content(), "sha256": calibration.sha256}
    report.record["baseline_mm"] = calibration.baseline_mm
    report.record["rectified"] = {
        **{name: getattr(geometry, name) for name in ("width", "height", "focal_px", "cx", "cy", "doffs")},
        "already": calibration.is_rectified,
    }
