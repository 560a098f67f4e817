"""Interlaced frames, slowly and plainly: what `images/interlacing` finds."""

from __future__ import annotations

import numpy as np

BANDS, ROWS, TILES_ALONG, TILE_COLUMNS = 16, 10, 12, 20
COLUMNS = TILES_ALONG * TILE_COLUMNS


def combed_share(frame: np.ndarray) -> float:
    """Return the share of tiles in which neighbouring rows differ clearly more than rows two apart."""
    height, width = frame.shape[:2]
    if width < COLUMNS or height < BANDS * ROWS:
        return float("nan")
    channel = (frame if frame.ndim == 2 else frame[..., frame.shape[2] // 2]).astype(int)
    columns = (np.arange(COLUMNS) * width + width // 2) // COLUMNS
    combed = 0
    for band in range(BANDS):
        top = (height - ROWS) * band // (BANDS - 1)
        for tile in range(TILES_ALONG):
            part = channel[top : top + ROWS, columns[tile * TILE_COLUMNS : (tile + 1) * TILE_COLUMNS]]
            one = ((part[2:] - part[1:-1]) ** 2).mean()
            two = ((part[2:] - part[:-2]) ** 2).mean()
            combed += bool(one > 2 and one > 1.5 * two)
    return combed / (BANDS * TILES_ALONG)
