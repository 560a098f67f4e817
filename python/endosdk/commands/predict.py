"""``endosdk predict``: one stereo pair from files to files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from endosdk.errors import InvalidArgument

if TYPE_CHECKING:
    from endosdk.runtime.result import DepthResult

VERTICAL_DISPARITY_LIMIT = 1.5  # px; beyond it rows of the two views do not correspond and matching along rows fails


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("left", type=Path, help="left view, a picture file")
    parser.add_argument("right", type=Path, help="right view, a picture file")
    parser.add_argument("--model", default="fast", help="shipped name or .onnx file (default: %(default)s)")
    parser.add_argument("--calibration", type=Path, help="rig file; without it the pair must be rectified already")
    parser.add_argument(
        "--network-size",
        metavar="WxH",
        help="size the network works at (default: what the model is made for)",
    )
    parser.add_argument("--provider", default="cpu", help="cpu, cuda, tensorrt (default: %(default)s)")
    parser.add_argument("--threads", type=int, help="processor threads (default: all)")
    parser.add_argument("--truth", type=Path, help="true disparity of the rectified left view, 16-bit PNG times 256")
    parser.add_argument("--frames", type=int, default=3, help="frames timed after the first (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the results (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Predict, write the files, print what was found."""
    from endosdk import DepthEstimator, StereoCalibration
    from endosdk.commands.sizes import parse_size
    from endosdk.evaluation.vertical_disparity import vertical_disparity
    from endosdk.io.pictures import read_frame, write_result

    left, right = read_frame(args.left), read_frame(args.right)
    rig = StereoCalibration.load(args.calibration) if args.calibration else None
    estimator = DepthEstimator(
        args.model,
        calibration=rig,
        provider=args.provider,
        threads=args.threads,
        network_size=parse_size(args.network_size) if args.network_size else None,
    )
    result = estimator.predict(left, right)
    totals = []
    for number in range(args.frames):
        print(f"\rtiming frame {number + 1} of {args.frames}", end="", flush=True)
        result = estimator.predict(left, right, out=result)
        totals.append(result.timings.total_ms)
    print("\r" + " " * 40 + "\r", end="")
    view, other = estimator.rectify(left, right)
    files = write_result(args.out, view, result)
    print(f"model      {result.model.name} {result.model.version} on {estimator.diagnostics()['provider']}")
    _print_maps(result)
    if totals:
        median = sorted(totals)[len(totals) // 2]
        t = result.timings
        stages = f"rectify {t.rectify_ms:.1f}, session {t.session_ms:.1f}, postprocess {t.postprocess_ms:.1f} ms"
        print(f"speed      {1000 / median:.2f} FPS ({stages})")
    if args.truth:
        _print_error(result, args.truth)
    offset = vertical_disparity(view, other)
    if offset.median_px is not None and offset.median_px > VERTICAL_DISPARITY_LIMIT:
        print(f"WARNING    rows differ by {offset.median_px:.1f} px (median): not rectified; give --calibration")
    for name, path in files.items():
        print(f"{'written' if name == 'disparity.png' else '':10} {path}")
    return 0


def _print_maps(result: DepthResult) -> None:
    answered = result.reasons == 0
    print(f"valid      {100 * result.valid_share:.1f} % of pixels, status {result.status.name}")
    if not answered.any():
        return
    low, mid, high = np.percentile(result.disparity[answered], (2, 50, 98))
    print(f"disparity  {low:.1f} .. {high:.1f} px (median {mid:.1f})")
    if result.depth_map is not None and result.sigma_map is not None:
        low, mid, high = np.percentile(result.depth_map[answered], (2, 50, 98))
        sigma = np.median(result.sigma_map[answered])
        print(f"depth      {low:.1f} .. {high:.1f} mm (median {mid:.1f}), expected error {sigma:.2f} mm (median)")


def _print_error(result: DepthResult, path: Path) -> None:
    from endosdk.datasets.dataset import read_disparity

    truth = read_disparity(path)
    if truth.shape != result.disparity.shape:
        raise InvalidArgument("truth", f"must have the size of the result, {result.disparity.shape}", truth.shape)
    error = np.abs(result.disparity - truth)[np.isfinite(truth)]
    bad = 100 * np.mean(error > 1)
    print(f"error      {error.mean():.3f} px against the truth, {bad:.1f} % of {error.size} pixels over 1 px")
