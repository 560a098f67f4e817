"""``endosdk predict``: one stereo pair from files to files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from endosdk import _core
from endosdk.commands.options import add_bits, add_estimator, made_estimator
from endosdk.commands.pair_report import matched_rows
from endosdk.commands.report import Report
from endosdk.errors import InvalidArgument

if TYPE_CHECKING:
    from endosdk.runtime.estimator import DepthEstimator
    from endosdk.runtime.maps import FloatMap
    from endosdk.runtime.result import DepthResult, Timings


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("left", type=Path, help="image file of the left view")
    parser.add_argument("right", type=Path, help="image file of the right view")
    add_estimator(parser)
    add_bits(parser)
    parser.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="true disparity of the rectified left view: 16-bit PNG, 256 x px; adds an error panel (default: none)",
    )
    parser.add_argument("--frames", type=int, default=3, help="number of timed repetitions, which change no result")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("out"), help="folder for the results")


def run(args: argparse.Namespace) -> int:
    """Predict, write the files, say what was found; the status is 1 where the maps cannot be used."""
    from endosdk import Status
    from endosdk.io.pictures import read_frame
    from endosdk.runtime.result_files import RESULT, described, write_record, write_result

    if args.frames < 0:
        raise InvalidArgument("frames", "must not be negative", args.frames)
    left, right = (read_frame(path, bits=args.bits) for path in (args.left, args.right))
    estimator = made_estimator(args)
    result = estimator.predict(left, right)
    timings, totals = _timed(estimator, left, right, args.frames)
    truth = _read_truth(args.truth, result) if args.truth else None
    views = estimator.rectify(left, right)
    files = write_result(args.out, views[0], result, truth)
    files[RESULT] = write_record(args.out, result, files, (args.left, args.right))
    report = Report(args)
    report.record = described(result)
    report.line(f"model      {result.model.name} {result.model.version} on {result.identity.provider}")
    _report_maps(report, result)
    _report_speed(report, timings, totals)
    if truth is not None:
        _report_error(report, result, truth)
    matched, words = matched_rows(views)
    report.record |= matched
    report.line(f"rows       {words}")
    report.record["files"] = files
    for number, path in enumerate(files.values()):
        report.line(f"{'' if number else 'written':10} {path}")
    return report.end(usable=result.status != Status.INVALID)


def _timed(
    estimator: DepthEstimator, left: np.ndarray, right: np.ndarray, frames: int
) -> tuple[Timings | None, list[float]]:
    """Repeat the prediction; return the stages of its last frame and the time of each frame, ms."""
    from endosdk.io.progress import progress

    result, totals = None, []
    for _ in progress(range(frames), unit="frame", title="timing", stays=False):
        result = estimator.predict(left, right, out=result)
        totals.append(result.timings.total_ms)
    return None if result is None else result.timings, totals


def _report_maps(report: Report, result: DepthResult) -> None:
    valid = result.reasons == 0
    report.line(f"valid      {100 * result.valid_share:.1f} % of pixels, status {result.status.name}")
    for cause in result.causes:
        fact = _core.cause_facts[cause]
        report.line(f"cause      {cause.name}: {fact['meaning']}; {fact['remedy']}")
    if not valid.any():
        return
    low, median, high = report.record["disparity_px"] = _percentiles(result.disparity[valid])
    report.line(f"disparity  {low:.1f} .. {high:.1f} px in 96 % of the valid pixels (median {median:.1f})")
    if result.depth_map is not None and result.sigma_map is not None:
        low, median, high = report.record["depth_mm"] = _percentiles(result.depth_map[valid])
        sigma = report.record["sigma_mm"] = float(np.median(result.sigma_map[valid]))
        report.line(
            f"depth      {low:.1f} .. {high:.1f} mm in 96 % of them (median {median:.1f}), "
            f"expected error {sigma:.2f} mm (median)"
        )


def _percentiles(values: FloatMap) -> list[float]:
    """Return the 2nd, 50th and 98th percentile."""
    return [float(value) for value in np.percentile(values, (2, 50, 98))]


def _report_speed(report: Report, timings: Timings | None, totals: list[float]) -> None:
    if timings is None:
        return
    fps = 1000 / sorted(totals)[len(totals) // 2]
    stages = {name: getattr(timings, f"{name}_ms") for name in ("rectify", "session", "postprocess")}
    report.record |= {"fps": fps, "stages_ms": stages}
    parts = ", ".join(f"{name} {value:.1f}" for name, value in stages.items())
    report.line(f"speed      {fps:.2f} FPS ({parts} ms)")


def _read_truth(path: Path, result: DepthResult) -> FloatMap:
    from endosdk.datasets.dataset import read_disparity

    truth = read_disparity(path)
    if truth.shape != result.disparity.shape:
        raise InvalidArgument("truth", f"must have the size of the result, {result.disparity.shape}", truth.shape)
    if not np.isfinite(truth).any():
        raise InvalidArgument("truth", "must hold the disparity of at least one pixel", path)
    return truth


def _report_error(report: Report, result: DepthResult, truth: FloatMap) -> None:
    from endosdk.evaluation.metrics import end_point_error, k_pixel_error, with_truth

    error, bad = end_point_error(result.disparity, truth), k_pixel_error(result.disparity, truth, 1)
    pixels = int(with_truth(truth).sum())
    report.record["error"] = {"epe_px": error, "kpe_1": bad, "pixels": pixels}
    report.line(f"error      {error:.3f} px against the ground truth, {100 * bad:.1f} % of {pixels} pixels over 1 px")
