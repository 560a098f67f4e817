"""What the rule at the end of a model's range does, for several margins: near surfaces marked, right answers dropped.

    python -m benchmarks.accuracy.range_end --data DIR --models fast wang2020 --json FILE

A network finds no disparity beyond its last plane: nearer surfaces come out at that plane, with high confidence. The
SDK marks answers within a margin of it as out of range. To have surfaces beyond, the right views are moved to the left
until a twentieth of all pixels lies beyond the last plane.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.model_records import models_parser, record_models
from endosdk import DepthEstimator, Reason
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset

MARGINS = (0.0, 0.25, 0.5, 0.75, 1.0, 2.0)  # px of the network
BEYOND = 0.05  # share of the pixels beyond the last plane
SAMPLED = 40_000  # pixels per pair

Pixels = dict[str, NDArray[Any]]


def moved(sample: Sample, shift: int) -> tuple[Sample, NDArray[np.bool_]]:
    """Add ``shift`` px to every disparity; also say which pixels have truth that the right view still shows."""
    right = np.concatenate([sample.right[:, shift:], np.repeat(sample.right[:, -1:], shift, axis=1)], axis=1)
    disparity = sample.disparity + np.float32(shift)
    with np.errstate(invalid="ignore"):
        visible = np.arange(disparity.shape[1]) - disparity >= 0
    fields = {**vars(sample), "right": np.ascontiguousarray(right), "disparity": disparity}
    return Sample(**fields), visible


def answers(estimator: DepthEstimator, reader: DatasetReader, pairs: int, shift: int, gain: float) -> Pixels:
    """Answer, truth (px of the network) and trust of pixels that both views show."""
    rng = np.random.default_rng(0)
    parts: list[NDArray[Any]] = []
    for number in range(pairs):
        sample, visible = moved(reader[number], shift)
        result = estimator.predict(sample.left, sample.right)
        seen = visible & ((result.reasons & (Reason.OCCLUDED | Reason.OUTSIDE_OVERLAP)) == 0)
        at = rng.permutation(np.flatnonzero(seen))[:SAMPLED]
        trusted = (result.reasons.ravel()[at] & Reason.LOW_CONFIDENCE) == 0
        parts.append(np.stack([result.disparity.ravel()[at] / gain, sample.disparity.ravel()[at] / gain, trusted]))
        print(f"pair {number + 1} of {pairs}", file=sys.stderr)
    found, truth, trusted = np.concatenate(parts, axis=1)
    return {"found": found, "truth": truth, "trusted": trusted > 0}


def scores(pixels: Pixels, max_candidate_disparity: int, margin: float) -> dict[str, float | None]:
    """Shares for one margin."""
    found, truth = pixels["found"], pixels["truth"]
    marked = found >= max_candidate_disparity - margin
    beyond = truth > max_candidate_disparity + 1
    right = (np.abs(found - truth) <= 1) & (truth <= max_candidate_disparity)
    near_end = right & (truth > max_candidate_disparity - 4)
    return {
        "margin_px": margin,
        "marked_of_surfaces_beyond": share(marked[beyond]),
        "marked_or_low_confidence_of_surfaces_beyond": share((marked | ~pixels["trusted"])[beyond]),
        "beyond_the_max_candidate_disparity_of_marked": share(truth[marked] > max_candidate_disparity),
        "marked_of_right_answers": share(marked[right]),
        "marked_of_right_answers_in_the_last_4_px": share(marked[near_end]),
    }


def share(holds: NDArray[np.bool_]) -> float | None:
    """Share of the pixels for which it holds; None of none."""
    return round(float(holds.mean()), 4) if holds.size else None


def measure(model: str, reader: DatasetReader, pairs: int) -> dict[str, Any]:
    """All margins for one model."""
    estimator = DepthEstimator(model)
    max_candidate_disparity = estimator.model.max_candidate_disparity
    if max_candidate_disparity is None:
        raise SystemExit(f"{model} does not state its last plane")
    first = reader[0]
    estimator.predict(first.left, first.right)
    gain = first.left.shape[1] / estimator.diagnostics()["network_width"]
    near = np.nanquantile([reader[number].disparity for number in range(pairs)], 1 - BEYOND)
    shift = max(0, round(max_candidate_disparity * gain - float(near)))
    pixels = answers(estimator, reader, pairs, shift, gain)
    beyond = pixels["truth"] > max_candidate_disparity + 1
    return {
        "max_candidate_disparity_px": max_candidate_disparity,
        "frame_px_per_network_px": gain,
        "shift_px": shift,
        "pairs": pairs,
        "pixels": int(beyond.size),
        "surfaces_beyond": share(beyond),
        "trusted_of_surfaces_beyond": share(pixels["trusted"][beyond]),
        "margins": [scores(pixels, max_candidate_disparity, margin) for margin in MARGINS],
    }


def main() -> None:
    args = models_parser(__doc__, "the first so many pairs").parse_args()
    reader = open_dataset(args.data, args.split)
    record_models(args, reader, lambda model: measure(model, reader, min(args.pairs, len(reader))))


if __name__ == "__main__":
    main()
