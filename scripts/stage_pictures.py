"""Draw what each stage of the frame path makes of the demo pair, for docs/how-it-works.md, and the README's picture.

python scripts/stage_pictures.py [--out docs/images] [--model fast] [--front SET ID]

The README shows a pair of the test split of endosim-lap: `--front sets/endosim-lap 2022500022`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.datasets.layouts import open_dataset
from endosdk.io.pictures import read_frame, write_picture
from endosdk.runtime.models import read_model
from endosdk.runtime.overview import colour_map, overview, robust_range
from endosdk.runtime.session import StereoSession, padded

Picture = npt.NDArray[np.uint8]
Map = npt.NDArray[np.floating]

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "examples" / "data"
WIDTH = 480  # px of one picture on the page
ROWS = (0.25, 0.5, 0.75)  # where lines are drawn, share of the height
GAP = 12  # px between pictures
LINE = (255, 230, 0)
PAPER = 255


def main() -> None:
    """Write one picture for each stage."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images", help="folder to write into")
    parser.add_argument("--model", default="fast", help="a shipped name")
    parser.add_argument("--front", nargs=2, metavar=("SET", "ID"), help="draw overview.jpg of this test pair")
    args = parser.parse_args()
    (args.out / "stages").mkdir(parents=True, exist_ok=True)
    pictures = stages(args.model) | (
        {"overview": front(args.model, Path(args.front[0]), args.front[1])} if args.front else {}
    )
    for name, picture in pictures.items():
        write_picture(args.out / f"{name}.jpg", picture)
        print(args.out / f"{name}.jpg")


def stages(model: str) -> dict[str, Picture]:
    """Return the picture of each stage by its name."""
    left, right = (read_frame(SAMPLES / "demo" / f"{side}.png") for side in ("left", "right"))
    estimator = DepthEstimator(model, calibration=StereoCalibration.load(SAMPLES / "rig.json"))
    result = estimator.predict(left, right)
    views = estimator.rectify(left, right)
    seen = estimator.rectified_pair()
    coarse, confidence = network_answer(estimator.model.name, *seen)
    low, high = robust_range(coarse)
    scale = result.disparity.shape[1] / seen[0].shape[1]
    return {
        "stages/1_raw": beside(*(with_rows(view) for view in (left, right))),
        "stages/2_rectified": beside(*(with_rows(view) for view in views)),
        "stages/3_seen": beside(*seen),
        "stages/4_network": beside(
            colour_map(coarse, low, high), colour_map(confidence, 0.0, 1.0, "trust"), sharp=True
        ),
        "stages/5_upsampled": beside(
            colour_map(coarse, low, high), colour_map(result.disparity / scale, low, high), sharp=True
        ),
        "stages/6_consistency": beside(views[0], matched(views[1], result)),
        "stages/7_result": shrunk(overview(views[0], result), 2 * WIDTH + GAP),
    }


def front(model: str, root: Path, name: str) -> Picture:
    """Return the overview of one pair of a rendered set, beside its truth."""
    reader = open_dataset(root, "test")
    pair = next(pair for pair in (reader[index] for index in range(len(reader))) if pair.id == name)
    size = pair.left.shape[1], pair.left.shape[0]
    rig = StereoCalibration.rectified(pair.focal_px, pair.baseline_mm, size, doffs=pair.doffs)
    result = DepthEstimator(model, calibration=rig).predict(pair.left, pair.right)
    return shrunk(overview(pair.left, result, pair.disparity), 3 * WIDTH)


def network_answer(model: str, left: Picture, right: Picture) -> tuple[Map, Map]:
    """Return disparity and confidence as the network gives them, in its own cells."""
    session = StereoSession(read_model(model))
    height, width = left.shape[:2]
    multiple, stride = session.info.input_multiple, session.info.output_stride
    run = NetworkRun(session, padded(height, multiple), padded(width, multiple))
    for buffer, view in ((run.left, left), (run.right, right)):
        more = ((0, buffer.shape[1] - height), (0, buffer.shape[2] - width), (0, 0))
        buffer[:] = np.pad(view, more, mode="edge").transpose(2, 0, 1)
    run()
    rows, columns = -(-height // stride), -(-width // stride)
    return run.disparity[:rows, :columns].copy(), run.confidence[:rows, :columns].copy()


def matched(right: Picture, result: DepthResult) -> Picture:
    """Take each pixel from where the result found it in the right view; black where it is not valid."""
    rows, columns = np.indices(result.disparity.shape, dtype=np.float32)
    taken = cv2.remap(right, columns - result.disparity, rows, cv2.INTER_LINEAR)
    taken[result.reasons != 0] = 0
    return np.asarray(taken, np.uint8)


def with_rows(view: Picture) -> Picture:
    """Draw lines along some rows, so that one sees whether a point lies in the same row of both views."""
    drawn = view.copy()
    for share in ROWS:
        row = int(share * len(view))
        drawn[row - 1 : row + 1] = LINE
    return drawn


def beside(*pictures: Picture, sharp: bool = False) -> Picture:
    """Lay pictures beside each other at one width; ``sharp`` keeps the cells of small maps."""
    resized = [shrunk(picture, WIDTH, sharp=sharp) for picture in pictures]
    height = min(len(picture) for picture in resized)
    gap = np.full((height, GAP, 3), PAPER, np.uint8)
    row = [part for picture in resized for part in (picture[:height], gap)]
    return np.ascontiguousarray(np.hstack(row[:-1]))


def shrunk(picture: Picture, width: int, *, sharp: bool = False) -> Picture:
    """Resize to a width."""
    size = (width, round(width * picture.shape[0] / picture.shape[1]))
    way = cv2.INTER_NEAREST if sharp and picture.shape[1] < width else cv2.INTER_AREA
    return np.asarray(cv2.resize(picture, size, interpolation=way), np.uint8)


if __name__ == "__main__":
    main()
