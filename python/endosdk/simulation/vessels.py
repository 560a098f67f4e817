"""Branching blood vessels that thin as they split, drawn as two masks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.noise import Array
from endosdk.simulation.tissue import Tissue

SUBPIXEL_BITS = 4
MAX_BRANCHES = 1500  # of one surface; bounds the time


def draw_vessels(rng: np.random.Generator, tissue: Tissue, shape: tuple[int, int], scale: float) -> tuple[Array, Array]:
    """Return masks [H,W] 0..1 of deep (soft) and of surface vessels; ``scale`` is px per mm."""
    import cv2

    area = shape[0] * shape[1] / scale**2
    deep, surface = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    if tissue.deep > 0.02:
        _forest(rng, deep, max(2, round(0.15 * area / 1000)), tissue.vessel_mm * 2.2 * scale, 0)
    trunk = tissue.vessel_mm * scale
    for share, width in ((1.0, trunk), (1.6, 0.6 * trunk), (2.5, 0.35 * trunk)):
        _forest(rng, surface, round(share * tissue.vessel_density * area / 1000), width, 3)
    soft = cv2.GaussianBlur(deep, (0, 0), max(0.6, 0.45 * scale))
    sharp = cv2.GaussianBlur(surface, (0, 0), max(0.4, 0.05 * scale))
    return _share(soft), _share(sharp)


def _share(mask: Any) -> Array:
    return np.asarray(mask, np.float32) / np.float32(255.0)


def _forest(rng: np.random.Generator, mask: NDArray[np.uint8], trees: int, width: float, splits: int) -> None:
    """Grow trees from random roots. A branch is (position, heading, width, splits left)."""
    height, length = mask.shape
    roots = rng.uniform(0.0, 1.0, (min(trees, 120), 4)) * (length, height, 2 * math.pi, 0.5 * width)
    queue = [(x, y, heading, 0.5 * width + extra, splits) for x, y, heading, extra in roots.tolist()]
    drawn = 0
    while queue and drawn < MAX_BRANCHES:
        x, y, heading, wide, left = queue.pop(0)
        steps = int(rng.integers(8, 26))
        stride = 2.2 * max(wide, 1.5) + 3.0
        # A bounded random turn: vessels wind, but seldom loop.
        turns = np.cumsum(rng.normal(0, 0.22, steps)) * 0.6 + rng.normal(0, 0.18, steps)
        headings = heading + turns
        xs = x + np.concatenate([[0.0], np.cumsum(np.cos(headings) * stride)])
        ys = y + np.concatenate([[0.0], np.cumsum(np.sin(headings) * stride)])
        end = wide * 0.78
        _stroke(mask, xs, ys, wide, end)
        drawn += 1
        if left > 0 and end > 0.35:
            spread = rng.uniform(0.3, 0.9)
            for side in (-1.0, 1.0):
                queue.append((xs[-1], ys[-1], headings[-1] + side * spread, end * rng.uniform(0.6, 0.9), left - 1))
        if left > 0 and rng.random() < 0.7:
            k = int(rng.integers(1, steps))
            side = 1.0 if rng.random() < 0.5 else -1.0
            queue.append((xs[k], ys[k], headings[k - 1] + side * rng.uniform(0.5, 1.3), wide * 0.5, left - 1))


def _stroke(mask: NDArray[np.uint8], xs: NDArray[np.float64], ys: NDArray[np.float64], wide: float, end: float) -> None:
    """Draw one branch, in three pieces of falling width."""
    import cv2

    height, length = mask.shape
    cuts = np.linspace(0, len(xs) - 1, 4).astype(int)
    # The texture wraps along both sides, so a vessel that leaves enters again opposite.
    for dx in {0.0, -math.floor(xs.min() / length) * length, -math.floor(xs.max() / length) * length}:
        for dy in {0.0, -math.floor(ys.min() / height) * height, -math.floor(ys.max() / height) * height}:
            points = np.stack([xs + dx, ys + dy], 1) * (1 << SUBPIXEL_BITS)
            fixed = np.round(points).astype(np.int32)
            for k in range(3):
                width = wide + (end - wide) * k / 2
                # Thinner than a pixel: one pixel wide, but fainter.
                level = int(255 * min(1.0, max(width, 0.25)))
                piece = fixed[cuts[k] : cuts[k + 1] + 1]
                cv2.polylines(mask, [piece], False, level, max(1, round(width)), cv2.LINE_AA, SUBPIXEL_BITS)
