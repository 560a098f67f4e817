"""The kept answer to one pair that has everything: a raw rig, a circle of view, glare, an edge, noise.

python -m tests.runtime.golden    # writes the maps anew, after a change that is meant to change them
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from endosdk import DepthEstimator, DepthResult
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

FILE = Path(__file__).parents[1] / "data" / "golden_maps.npz"
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


def main() -> None:
    """Write the file."""
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
