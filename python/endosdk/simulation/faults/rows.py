"""Rows that do not agree: the right view moves up and down, and nothing moves along its row.

Rows that disagree are modelled by vertical displacement alone: a shift, a roll (more towards one side) and a difference
of scale (more towards top or bottom). A point keeps its column, so the disparity along the row stays exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.simulation.noise import Array

LARGEST_PX = 2.0  # of a frame 960 wide
FRAME_PX = 960


@dataclass(frozen=True)
class Rows:
    """How far down the right view's content lies, in px of a frame 960 wide: at its middle, and more at its borders."""

    shift: float
    roll: float  # at the right border
    scale: float  # at the bottom

    def field(self, size: tuple[int, int]) -> Array:
        """Return the vertical disparity [H,W] in px: the right view's row minus the left view's row."""
        height, width = size
        y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j].astype(np.float32)
        return np.asarray((self.shift + self.roll * x + self.scale * y) * (width / FRAME_PX), np.float32)


def draw_rows(rng: np.random.Generator) -> Rows:
    """Draw vertical disparity of at most 2 px anywhere in a frame 960 wide."""
    largest = float(rng.uniform(0.2, LARGEST_PX))
    parts = rng.uniform(-1, 1, 3) * np.array([1.0, 0.5, 0.3])
    parts = parts / np.abs(parts).sum() * largest
    return Rows(float(parts[0]), float(parts[1]), float(parts[2]))


def move_view(view: Array, rows: Rows) -> Array:
    """Return the right view [H,W,3] with its content moved."""
    import cv2

    return np.asarray(
        cv2.remap(view, *_source(view, rows), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float32
    )


def move_truth(disparity: Array, rows: Rows) -> Array:
    """Return the right view's truth [H,W] for the moved content, from the nearest row; NaN where it came from outside.

    Between two rows the mean over an edge would be a surface that is not there.
    """
    import cv2

    columns, places = _source(disparity, rows)
    moved = cv2.remap(
        disparity, columns, np.rint(places), cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan")
    )
    return np.asarray(moved, np.float32)


def _source(picture: Array, rows: Rows) -> tuple[Array, Array]:
    size = (picture.shape[0], picture.shape[1])
    places, columns = np.indices(size, np.float32)
    return np.asarray(columns, np.float32), np.asarray(places - rows.field(size), np.float32)
