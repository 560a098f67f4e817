"""What packing a set did to it: noise in the pictures, and the error that StereoSGBM makes on both forms.

    python -m benchmarks.studies.packing --rendered DIR --packed datasets/endosim-gi-cycles --json FILE

Packed truth must be the rendered truth to the bit; how far it is off is recorded all the same.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.record import NO_MODEL, write_record
from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.methods import evaluate, sgbm_method

REGIONS = ("all", "non_occluded")


def compare(rendered: DatasetReader, packed: DatasetReader) -> dict[str, Any]:
    """Return what differs between the two forms of the same samples, over all of them."""
    if rendered.ids != packed.ids:
        raise SystemExit(f"{rendered.root} and {packed.root} do not hold the same samples")
    noise, largest, truth = [], 0, 0.0
    for before, after in zip(rendered, packed, strict=True):
        for one, other in ((before.left, after.left), (before.right, after.right)):
            noise.append(float(cv2.PSNR(one, other)))
            largest = max(largest, int(cv2.absdiff(one, other).max()))
        if not np.array_equal(np.isnan(before.disparity), np.isnan(after.disparity)):
            raise SystemExit(f"{after.id}: the packed truth lacks pixels")
        truth = max(truth, float(np.nanmax(np.abs(before.disparity - after.disparity))))
    return {
        "psnr_db": {"mean": float(np.mean(noise)), "least": min(noise)},
        "largest_step_in_a_view": largest,
        "largest_error_of_truth_px": truth,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rendered", type=Path, required=True, help="the set as it was rendered")
    parser.add_argument("--packed", type=Path, required=True, help="the same set, packed")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    sets = {"rendered": open_dataset(args.rendered, "test"), "packed": open_dataset(args.packed, "test")}
    scores: dict[str, Any] = {}
    for form, reader in sets.items():
        for filled in (True, False):
            print(form, "filled" if filled else "as it is", file=sys.stderr)
            score = evaluate(sgbm_method(filled=filled), reader)
            scores.setdefault(form, {})["sgbm-filled" if filled else "sgbm"] = {name: score[name] for name in REGIONS}
    size = {form: sum(f.stat().st_size for f in reader.root.rglob("*") if f.is_file()) for form, reader in sets.items()}
    record = {
        "dataset": {"name": sets["packed"].name, "split": "test", "pairs": len(sets["packed"])},
        "sha256": {form: reader.sha256 for form, reader in sets.items()},
        "bytes": size,
        **compare(sets["rendered"], sets["packed"]),
        "methods": scores,
    }
    command = f"python -m benchmarks.studies.packing --rendered {args.rendered.name} --packed {args.packed}"
    write_record(args.json, record, command=command, hashes=NO_MODEL)
    for form, score in scores.items():
        print(form, {name: round(m["all"]["epe_px"], 4) for name, m in score.items()})
    print(f"views {record['psnr_db']['mean']:.1f} dB, least {record['psnr_db']['least']:.1f} dB")


if __name__ == "__main__":
    main()
