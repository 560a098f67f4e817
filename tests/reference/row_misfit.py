"""The slow NumPy twin of the parts of a picture that no rig explains, written to be read."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

BANDS, ALONG = 3, 12  # measurements of a part
LEAST_MEASURED = 10
MOST_SCATTER = 0.6


def upper_median(values: np.ndarray) -> float:
    return float(np.sort(values)[len(values) // 2])


def row_misfit(rest: np.ndarray, least: float, limit: float) -> tuple[float, np.ndarray | None]:
    """Share of the parts that do not fit, and 0 there and beside them, 1 elsewhere; None below the limit."""
    down, across = rest.shape[0] // BANDS, rest.shape[1] // ALONG
    found = np.zeros((down, across), bool)
    for row, column in np.ndindex(down, across):
        part = rest[row * BANDS : (row + 1) * BANDS, column * ALONG : (column + 1) * ALONG]
        values = part[np.isfinite(part)]
        if len(values) < LEAST_MEASURED:
            continue
        middle = upper_median(values)
        scatter = upper_median(np.abs(values - np.float32(middle)))
        found[row, column] = abs(middle) > least and scatter < np.float32(MOST_SCATTER) * abs(middle)
    if found.mean() < limit:
        return found.mean(), None
    return found.mean(), 1.0 - binary_dilation(found, np.ones((3, 3)))
