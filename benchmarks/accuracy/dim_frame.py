"""A real frame of a silicone heart, also with little light and with a circular field of view: what of it is valid?

    python -m benchmarks.accuracy.dim_frame --data DIR --json FILE

DIR holds the pair with its calibration, and a mask of a disc of the heart. The frame has no truth. Light and field of
view are those of `trust_cases`, put on the raw views. Shares are of the rectified left view: valid inside the mask, on
what is lit, on the dark ground behind the heart, and outside the field of view.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.trust_cases import USABLE
from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk import DepthEstimator, DepthResult, Reason, StereoCalibration
from endosdk.datasets.dataset import Sample
from endosdk.io.pictures import read_frame

MODELS = ("fast", "fast-320", "accurate", "wang2020")
CASES = {case.name: case for case in USABLE}
DARKER, CIRCLE = CASES["exposure x 0.25"], CASES["circular field of view"]
BOTH = f"{DARKER.name}, {CIRCLE.name}"
VARIANTS = {"as it is": (), DARKER.name: (DARKER,), CIRCLE.name: (CIRCLE,), BOTH: (DARKER, CIRCLE)}
STATED = f"{BOTH}, stated in the rig file"
DARK = 24  # grey levels, of the frame as it is: below is the ground behind the heart

Mask = NDArray[np.bool_]


def shares(answer: DepthResult, where: Mask) -> dict[str, Any] | None:
    """Return the share of valid pixels of a region [H,W], and that of each reason; None of an empty region."""
    if not where.any():
        return None
    reasons = answer.reasons[where]
    told = {str(reason.name): float(((reasons & reason.value) != 0).mean()) for reason in Reason}
    return {
        "pixels": int(where.sum()),
        "valid": round(float((reasons == 0).mean()), 4),
        "reasons": {name: round(share, 4) for name, share in told.items() if share > 0},
    }


def stated(rig: StereoCalibration, outside: Mask) -> StereoCalibration:
    """Return the rig with a circular field of view, in both views that of the left one."""
    (x, y), radius = cv2.minEnclosingCircle(np.argwhere(~outside)[:, ::-1].astype(np.float32))
    field = (x, y, radius, radius)
    return replace(rig, left_field_of_view=field, right_field_of_view=field)


def measure(model: str, pair: Sample, mask: NDArray[np.uint8], rig: StereoCalibration) -> dict[str, Any]:
    """Return what a model says of each variant of a raw pair; ``mask`` [H,W,3] is bright on tissue of its left view."""
    found = {}
    for name, cases in VARIANTS.items():
        shown = pair
        for case in cases:
            shown = case.pair(shown)
        found[name] = _judged(model, shown, pair.left, mask, rig)
    found[STATED] = _judged(model, shown, pair.left, mask, stated(rig, shown.info["outside"]))
    return found


def _judged(
    model: str, shown: Sample, light: NDArray[np.uint8], mask: NDArray[np.uint8], rig: StereoCalibration
) -> dict[str, Any]:
    outside = shown.info.get("outside", np.zeros(mask.shape[:2], np.bool_))
    beyond = np.repeat(np.where(outside, np.uint8(255), np.uint8(0))[..., None], 3, axis=2)
    with DepthEstimator(model, calibration=rig, threads=2) as estimator:
        answer = estimator.predict(shown.left, shown.right)
        tissue, out, lit = (estimator.rectify(picture, picture)[0] for picture in (mask, beyond, light))
    seen = out[..., 0] < 128
    dark = cv2.GaussianBlur(lit, (0, 0), 2).max(axis=2) < DARK
    regions = {"mask": tissue[..., 0] > 127, "lit": seen & ~dark, "dark": seen & dark, "outside": ~seen}
    return {
        "status": answer.status.name,
        "causes": {cause.name: round(value, 3) for cause, value in answer.causes.items()},
        **{region: shares(answer, where) for region, where in regions.items()},
    }


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the frame")
    parser.add_argument("--models", nargs="+", default=list(MODELS))
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    left, right, mask = (read_frame(args.data / f"f7_dynamic_deint_{which}_0100.png") for which in ("L", "R", "mask"))
    rig = StereoCalibration.load(args.data, size=left.shape[1::-1])
    nothing = np.full(left.shape[:2], np.nan, np.float32)
    pair = Sample(args.data.name, left, right, nothing, None, None, np.nan, np.nan)
    record = {
        "frame": f"{args.data.name}, {left.shape[1]}x{left.shape[0]}",
        "calibration_sha256": rig.sha256,
        "models": {model: measure(model, pair, mask, rig) for model in args.models},
    }
    hashes = {"model_sha256": {model: model_run(model).sha256 for model in args.models}}
    command = f"python -m benchmarks.accuracy.dim_frame --data {args.data.name} --models {' '.join(args.models)} "
    write_record(args.json, record, command=f"{command}--json FILE", hashes=hashes)
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
