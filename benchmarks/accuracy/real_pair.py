"""A model on one real rectified pair without truth: does it agree with StereoSGBM, and do the warped views match?

    python -m benchmarks.accuracy.real_pair LEFT RIGHT --model wang2020 --network-size 808x768 --json FILE

StereoSGBM (eight paths, 128 px) stands in for truth only where it answers, so the figures are agreement, not error. The
photometric difference is the mean absolute difference in grey levels between the left view and the right view warped by
the disparity, over pixels with an answer; the same without warping says what it is to be compared with.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import cv2
import numpy as np

from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.commands.options import parse_size
from endosdk.evaluation.sgbm import SgbmBaseline, SgbmSettings
from endosdk.evaluation.vertical_disparity import vertical_disparity
from endosdk.io.pictures import read_frame


def photometric(left: np.ndarray, right: np.ndarray, disparity: np.ndarray, where: np.ndarray) -> float:
    height, width = disparity.shape
    columns = np.arange(width, dtype=np.float32)[None] - disparity
    rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, 1)
    warped = cv2.remap(right, columns.astype(np.float32), rows, cv2.INTER_LINEAR)
    return float(np.abs(warped.astype(np.float32) - left).mean(axis=2)[where].mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("left", type=Path)
    parser.add_argument("right", type=Path)
    parser.add_argument("--model", default="wang2020")
    parser.add_argument("--network-size", required=True)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    left, right = read_frame(args.left), read_frame(args.right)
    result = DepthEstimator(args.model, network_size=parse_size(args.network_size)).predict(left, right)
    filled_sgbm = SgbmBaseline(SgbmSettings(max_disparity=128, eight_paths=True)).compute(left, right)
    both = np.isfinite(filled_sgbm) & (result.reasons == 0)
    apart = np.abs(result.disparity - filled_sgbm)[both]
    offset = vertical_disparity(left, right)
    record = {
        "pair": f"{args.left.parent.name}, {left.shape[1]}x{left.shape[0]}",
        "vertical_disparity_px": offset.median_px,
        "coverage": result.valid_share,
        "disparity_px": [float(v) for v in np.percentile(result.disparity[result.reasons == 0], (2, 50, 98))],
        "sgbm_hh_coverage": float(np.isfinite(filled_sgbm).mean()),
        "difference_to_sgbm_hh_px": {
            "median": float(np.median(apart)),
            "over_1": float((apart > 1).mean()),
            "over_3": float((apart > 3).mean()),
        },
        "photometric_levels": {
            "warped": photometric(left, right, result.disparity, result.reasons == 0),
            "unwarped": photometric(left, right, np.zeros_like(result.disparity), result.reasons == 0),
        },
    }
    command = f"python -m benchmarks.accuracy.real_pair LEFT RIGHT --model {args.model} "
    command += f"--network-size {args.network_size}"
    write_record(args.json, record, command=command, hashes={"model_sha256": result.model.sha256})
    print(json.dumps({k: record[k] for k in ("difference_to_sgbm_hh_px", "photometric_levels", "coverage")}))


if __name__ == "__main__":
    main()
