"""Count what a data set contains: ``python examples/describe_set.py SET SPLIT [HISTOGRAM.png]``.

The script prints the numbers as JSON. The histogram shows the share of pixels at each disparity.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.frame_parts import has_instruments

STEP_PX, MOST_BARS = 2.0, 36
BAR, HEIGHT, MARGIN = 20, 240, 34
BLUE, BLACK = (170, 90, 30), (0, 0, 0)  # as OpenCV orders channels


def describe(reader: DatasetReader) -> dict[str, Any]:
    """Return counts and disparities, in px, over all samples; shares are of all pixels, or of those with truth."""
    organs: Counter[str] = Counter()
    largest = float(reader.record["disparity_limits_px"]["largest"])
    step = STEP_PX * np.ceil(largest / (STEP_PX * MOST_BARS))
    edges = np.arange(0.0, largest + step, step)
    counts = np.zeros(len(edges) - 1, np.int64)
    tools = pixels = known_pixels = occluded = 0
    least, most, means = [], [], []
    for sample in reader:
        known = sample.disparity[np.isfinite(sample.disparity)]
        organs[sample.info["organ"]] += 1
        tools += has_instruments(sample.info)
        counts += np.histogram(known, edges)[0]
        pixels += sample.disparity.size
        known_pixels += known.size
        occluded += 0 if sample.occlusion is None else int(sample.occlusion.sum())
        if known.size:
            least.append(float(known.min()))
            most.append(float(known.max()))
            means.append(float(known.mean()))
    return {
        "pairs": len(reader),
        "organs": dict(organs),
        "with_tool": tools,
        "disparity_px": {"least": min(least), "most": max(most), "mean": float(np.mean(means))},
        "mean_disparity_of_a_pair_px": [min(means), max(means)],
        "without_truth": 1.0 - known_pixels / pixels,
        "occluded": occluded / pixels,
        "histogram": {"edges_px": edges.tolist(), "share": (counts / known_pixels).round(5).tolist()},
    }


def draw(shares: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return a bar chart [H,W,3] of the share of pixels at each disparity."""
    chart = np.full((HEIGHT + 2 * MARGIN, BAR * len(shares) + 2 * MARGIN, 3), 255, np.uint8)
    floor = MARGIN + HEIGHT
    for k, share in enumerate(shares):
        left = MARGIN + k * BAR
        top = floor - round(HEIGHT * share / shares.max())
        cv2.rectangle(chart, (left + 1, top), (left + BAR - 2, floor), BLUE, -1)
        if k % 5 == 0:
            _write(chart, f"{edges[k]:.0f}", (left - 6, floor + 18))
    _write(chart, f"share of pixels by disparity in px; tallest bar {100 * shares.max():.1f} %", (MARGIN, 22))
    return chart


def _write(chart: np.ndarray, text: str, place: tuple[int, int]) -> None:
    cv2.putText(chart, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, BLACK, 1, cv2.LINE_AA)


def main(root: str, split: str, picture: str | None = None) -> None:
    """Print the description; draw the histogram where a picture is named."""
    reader = open_dataset(root, split)
    facts = {"name": reader.name, "split": split, "sha256": reader.sha256, **describe(reader)}
    print(json.dumps(facts, indent=1))
    if picture is not None:
        Path(picture).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(picture, draw(*(np.asarray(facts["histogram"][name]) for name in ("share", "edges_px"))))


if __name__ == "__main__":
    main(*sys.argv[1:4])
