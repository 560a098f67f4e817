"""Show left views of a data set on one sheet: ``python examples/contact_sheet.py SET SPLIT ORGAN SHEET.jpg``.

The sheet shows the first 24 views of the organ. ``all`` stands for every organ.
"""

from __future__ import annotations

import sys
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from endosdk.datasets.layouts import open_dataset

COLUMNS, ROWS, WIDTH = 6, 4, 240


def main(root: str, split: str, organ: str, sheet: str) -> None:
    wanted = (s for s in open_dataset(root, split) if organ in ("all", s.info["organ"]))
    tiles = []
    for sample in islice(wanted, COLUMNS * ROWS):
        height = round(WIDTH * sample.left.shape[0] / sample.left.shape[1])
        tiles.append(cv2.resize(sample.left, (WIDTH, height), interpolation=cv2.INTER_AREA))
    tallest = max((tile.shape[0] for tile in tiles), default=0)
    tiles = [np.pad(tile, ((0, tallest - tile.shape[0]), (0, 0), (0, 0))) for tile in tiles]
    if len(tiles) < COLUMNS * ROWS:
        sys.exit(f"{root} has only {len(tiles)} such pairs; a sheet needs {COLUMNS * ROWS}")
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    Path(sheet).parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(sheet, np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main(*sys.argv[1:5])
