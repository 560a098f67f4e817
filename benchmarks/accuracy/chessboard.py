"""How well a given calibration rectifies real chessboard pairs: rows that agree, and lengths in mm.

    python -m benchmarks.accuracy.chessboard --data DIR --json FILE

DIR holds the calibration in the plain text layout and ``left/``, ``right/`` with pictures and ``*.points.txt``, the
detected corners row by row. Takes about two seconds. No square size is given with the boards, so the lengths are
checked through it: the pose of the left view alone gives depth in squares, triangulation gives it in mm, and their
ratio must be one and the same square in every pair.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.record import NO_MODEL, write_record
from endosdk.calibration.board import calibrate_board, rectify_points, row_correlation
from endosdk.calibration.rig import StereoCalibration

Points = npt.NDArray[np.float64]

SIZE = (1920, 1080)
PATTERN = (14, 10)
COMMAND = "python -m benchmarks.accuracy.chessboard --data DIR --json FILE"


def read_corners(folder: Path) -> tuple[list[str], list[Points], list[Points]]:
    """Return pair names and the corners [140,2] of left and right views."""
    lefts = sorted((folder / "left").glob("*.points.txt"))
    names = [path.name.split(".")[0].removeprefix("left-") for path in lefts]
    rights = [folder / "right" / path.name.replace("left", "right") for path in lefts]
    return names, [np.loadtxt(path) for path in lefts], [np.loadtxt(path) for path in rights]


def measure(folder: Path) -> dict[str, Any]:
    """Return the vertical disparity over all pairs, one by one, and the square size each pair implies."""
    rig = StereoCalibration.load(folder, size=SIZE)
    names, lefts, rights = read_corners(folder)
    median, p95 = row_correlation(rig, lefts, rights)
    # How far the pictures' own rows are apart, and what the same corners allow when the rig is solved from them.
    raw = np.abs(np.concatenate([a[:, 1] - b[:, 1] for a, b in zip(lefts, rights, strict=True)]))
    solved = calibrate_board(lefts, rights, PATTERN, square_mm=3.0, size=SIZE)
    return {
        "corners": int(sum(len(points) for points in lefts)),
        "row_difference_px": {"median": median, "p95": p95},
        "row_difference_before_px": {"median": float(np.median(raw)), "p95": float(np.percentile(raw, 95))},
        "row_difference_own_calibration_px": {"median": solved.row_median_px, "p95": solved.row_p95_px},
        "baseline_mm": rig.baseline_mm,
        "calibration_sha256": rig.sha256,
        "pairs": {name: _pair(rig, a, b) for name, a, b in zip(names, lefts, rights, strict=True)},
    }


def _pair(rig: StereoCalibration, left: Points, right: Points) -> dict[str, float]:
    geometry = rig.rectification()
    a, b = rectify_points(rig, left, right)
    depth = geometry.depth_of(a[:, 0] - b[:, 0])
    rows = np.abs(a[:, 1] - b[:, 1])
    return {
        "row_median_px": float(np.median(rows)),
        "row_p95_px": float(np.percentile(rows, 95)),
        "depth_mm": float(np.median(depth)),
        "square_mm": float(np.median(depth / _depth_in_squares(rig, left))),
    }


def _depth_in_squares(rig: StereoCalibration, left: Points) -> Points:
    """Depth of every corner in the rectified left frame, from the left view alone, with the square as the unit."""
    import cv2

    columns, rows = PATTERN
    board = np.zeros((rows * columns, 3))
    board[:, :2] = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    coefficients = rig.left_distortion.reshape(1, -1).copy()
    _, turn, place = cv2.solvePnP(board, left, rig.left_matrix.copy(), coefficients)
    seen = board @ cv2.Rodrigues(turn)[0].T + place.ravel()
    return np.asarray((seen @ rig.rectification().R1.T)[:, 2])


def main() -> int:
    """Measure, print the two numbers that matter, write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--json", type=Path, required=True)
    options = parser.parse_args()
    result = measure(options.data)
    rows = result["row_difference_px"]
    print(f"rows differ by {rows['median']:.3f} px (median), {rows['p95']:.3f} px (95th percentile)")
    for name, pair in result["pairs"].items():
        square = f"square {pair['square_mm']:.3f} mm"
        print(f"pair {name}: {pair['row_median_px']:.2f} px, {pair['depth_mm']:.0f} mm away, {square}")
    write_record(options.json, result, command=COMMAND, hashes=NO_MODEL)
    print(f"written {options.json}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
