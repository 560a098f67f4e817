"""The kept answers: of a small network to one pair that has everything (a raw rig, a circle of view, glare, an edge,
noise), and of the shipped `fast` to the demo pair, in cells.

python -m tests.runtime.golden    # writes the maps anew, after a change that is meant to change them
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.io.pictures import read_frame
from endosdk.runtime.models import shipped_models
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

FILE = Path(__file__).parents[1] / "data" / "golden_maps.npz"
DEMO_FILE = FILE.with_name("golden_demo.npz")
CELLS = (9, 12)  # rows, columns
SIZE = (240, 320)  # rows, columns
MAPS = ("disparity", "confidence", "reasons", "depth", "sigma")


def pair() -> tuple[np.ndarray, np.ndarray]:
    """The raw frames, the same on every machine."""
    left, right = shifted_pair(*SIZE, 9)
    nearer = shifted_pair(*SIZE, 16, seed=3)
    views = []
    for view, near, shift in ((left, nearer[0], 0), (right, nearer[1], 16)):
        view = np.maximum(view, 30)
        view[90:150, 180 - shift : 250 - shift] = near[90:150, 180 - shift : 250 - shift]
        view[60:80, 100 - shift // 2 : 130 - shift // 2] = 255
        noise = np.random.default_rng(shift).normal(0, 3, view.shape)
        rows, columns = np.indices(SIZE)
        dark = np.hypot(columns - 160, rows - 120) > 150
        views.append(np.clip(np.where(dark[..., None], 6, view) + noise, 0, 255).astype(np.uint8))
    return views[0], views[1]


def answer() -> DepthResult:
    """What the estimator says of the pair."""
    with DepthEstimator(TINY_MODEL, calibration=raw_rig().scaled(*SIZE[::-1])) as estimator:
        return estimator.predict(*pair())


def demo_answer() -> DepthResult:
    """What `fast` says of the demo pair; its own file, on every processor."""
    samples = ROOT / "examples" / "data"
    rig = StereoCalibration.load(samples / "rig.json")
    with DepthEstimator(shipped_models()["fast"], calibration=rig) as estimator:
        return estimator.predict(*(read_frame(samples / "demo" / f"{side}.png") for side in ("left", "right")))


def in_cells(result: DepthResult) -> dict[str, np.ndarray]:
    """Means over the valid pixels of each cell of the maps, and the share of these pixels."""
    valid = result.reasons == 0
    maps = {name: np.where(valid, getattr(result, name), np.nan) for name in MAPS if name != "reasons"}
    cells = {name: np.array([np.nanmean(cell) for cell in cells_of(values)]) for name, values in maps.items()}
    return {**cells, "valid": np.array([cell.mean() for cell in cells_of(valid)])}


def cells_of(values: np.ndarray) -> list[np.ndarray]:
    """The cells of a map, row by row."""
    return [cell for row in np.array_split(values, CELLS[0]) for cell in np.array_split(row, CELLS[1], axis=1)]


def main() -> None:
    """Write the files."""
    np.savez_compressed(DEMO_FILE, **in_cells(demo_answer()))
    result = answer()
    measures = {cause.name: measure for cause, measure in result.measures.items()}
    np.savez_compressed(
        FILE,
        **{name: getattr(result, name)[::2, ::2] for name in MAPS},
        status=int(result.status),
        names=list(measures),
        measures=list(measures.values()),
    )


if __name__ == "__main__":
    main()
