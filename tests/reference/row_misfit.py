"""The slow NumPy twin of the parts of a picture that no rig explains, written to be read."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, convolve

BANDS, ALONG = 3, 12  # measurements of a part
LEAST_MEASURED = 10
MOST_SCATTER = 0.6
WEIGHT_ALONE = 0.5  # of a part that does not fit while all beside it do
WITHOUT_DEPTH = np.float32(1.5)  # times the least misfit: parts that lose their depth
AROUND = np.ones((3, 3), int)


def upper_median(values: np.ndarray) -> float:
    return float(np.sort(values)[len(values) // 2])


def row_misfit(rest: np.ndarray, least: float, limit: float) -> tuple[float, np.ndarray | None]:
    """Share of the parts that do not fit; 0 at and beside those that fit worst, 1 elsewhere, None below the limit."""
    down, across = rest.shape[0] // BANDS, rest.shape[1] // ALONG
    misfit = np.zeros((down, across), np.float32)
    for row, column in np.ndindex(down, across):
        part = rest[row * BANDS : (row + 1) * BANDS, column * ALONG : (column + 1) * ALONG]
        values = part[np.isfinite(part)]
        if len(values) < LEAST_MEASURED:
            continue
        middle = upper_median(values)
        scatter = upper_median(np.abs(values - np.float32(middle)))
        if scatter < np.float32(MOST_SCATTER) * abs(middle):
            misfit[row, column] = abs(middle)
    least = np.float32(least)
    found = misfit > least
    alone = found & (convolve(found.astype(int), AROUND, mode="constant") == 1)
    share = np.where(alone, WEIGHT_ALONE, found).mean()
    if share < limit:
        return share, None
    return share, 1.0 - binary_dilation(misfit > WITHOUT_DEPTH * least, AROUND)
