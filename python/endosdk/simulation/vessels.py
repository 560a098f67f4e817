"""Branching blood vessels that thin as they split, drawn as two masks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.curve import Floats
from endosdk.simulation.noise import Array
from endosdk.simulation.tissue import Tissue

SUBPIXEL_BITS = 4
STEPS = 16  # of one branch
MAX_TREES = 300  # of one kind on one surface; bounds the time
FAINTEST = 0.3  # width in px below which a vessel is not followed further


def draw_vessels(rng: np.random.Generator, tissue: Tissue, shape: tuple[int, int], scale: float) -> tuple[Array, Array]:
    """Return masks [H,W] 0..1 of deep (soft) and of surface vessels; ``scale`` is px per mm."""
    import cv2

    area = shape[0] * shape[1] / scale**2
    deep, surface = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    if tissue.deep > 0.02:
        _grow(rng, deep, max(2, round(0.15 * area / 1000)), tissue.vessel_mm * 2.2 * scale, 1)
    trunk = tissue.vessel_mm * scale
    for share, width in ((2.5, 0.35 * trunk), (1.6, 0.6 * trunk), (1.0, trunk)):
        _grow(rng, surface, round(share * tissue.vessel_density * area / 1000), width, 3)
    soft = cv2.GaussianBlur(deep, (0, 0), max(0.6, 0.45 * scale))
    sharp = cv2.GaussianBlur(surface, (0, 0), max(0.4, 0.05 * scale))
    return _share(soft), _share(sharp)


def _share(mask: Any) -> Array:
    return np.asarray(mask, np.float32) / np.float32(255.0)


def _grow(rng: np.random.Generator, mask: NDArray[np.uint8], trees: int, width: float, splits: int) -> None:
    """Grow trees from random roots, one generation of branches after the other, all branches of one at once."""
    count = min(trees, MAX_TREES)
    height, length = mask.shape
    start = rng.uniform(0.0, 1.0, (count, 2)) * (length, height)
    heading = rng.uniform(0.0, 2 * math.pi, count)
    wide = width * rng.uniform(0.5, 1.0, count)
    for _ in range(splits + 1):
        count = len(wide)
        if count == 0:
            return
        # A bounded random turn: vessels wind, but seldom loop.
        turns = 0.6 * np.cumsum(rng.normal(0, 0.22, (count, STEPS)), 1) + rng.normal(0, 0.18, (count, STEPS))
        headings = heading[:, None] + turns
        stride = (2.2 * np.maximum(wide, 1.5) + 3.0) * rng.uniform(0.7, 1.7, count) ** 2
        moves = np.stack([np.cos(headings), np.sin(headings)], -1) * stride[:, None, None]
        points = np.concatenate([start[:, None], start[:, None] + np.cumsum(moves, 1)], 1)
        _draw(mask, points, wide)
        start, heading, wide = _split(rng, points, headings, wide)
        strong = wide > FAINTEST
        start, heading, wide = start[strong], heading[strong], wide[strong]


def _split(rng: np.random.Generator, points: Floats, headings: Floats, wide: Floats) -> tuple[Floats, Floats, Floats]:
    """Return start, heading and width of the next generation: a fork at each tip, and often a twig on the way."""
    count = len(wide)
    spread = rng.uniform(0.3, 0.9, count)
    tips, ends = points[:, -1], headings[:, -1]
    place = rng.integers(1, STEPS, count)
    rows = np.arange(count)
    side = rng.choice([-1.0, 1.0], count) * rng.uniform(0.5, 1.3, count)
    twigs = rng.random(count) < 0.7
    return (
        np.concatenate([tips, tips, points[rows, place][twigs]]),
        np.concatenate([ends - spread, ends + spread, (headings[rows, place - 1] + side)[twigs]]),
        np.concatenate([wide * rng.uniform(0.5, 0.75, count), wide * rng.uniform(0.4, 0.7, count), 0.45 * wide[twigs]]),
    )


def _draw(mask: NDArray[np.uint8], points: Floats, wide: Floats) -> None:
    """Draw branches [N,S,2], each in two pieces of falling width, with one call for all pieces that look alike."""
    import cv2

    points, wide = _wrapped(points, wide, mask.shape)
    middle = STEPS // 2
    fixed = np.round(points * (1 << SUBPIXEL_BITS)).astype(np.int32)
    for piece, widths in ((fixed[:, : middle + 1], wide), (fixed[:, middle:], 0.85 * wide)):
        thickness = np.maximum(1, np.round(widths)).astype(int)
        # Thinner than a pixel: one pixel wide, but fainter.
        level = (np.ceil(np.clip(widths, 0.25, 1.0) * 8) * 31).astype(int)
        for look in sorted(set(zip(level.tolist(), thickness.tolist(), strict=True))):
            alike = piece[(level == look[0]) & (thickness == look[1])]
            cv2.polylines(mask, list(alike), False, look[0], look[1], cv2.LINE_AA, SUBPIXEL_BITS)


def _wrapped(points: Floats, wide: Floats, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Add copies of the branches that leave the texture, shifted to where they enter again opposite."""
    for axis, period in ((0, shape[1]), (1, shape[0])):
        low = np.floor(points[..., axis].min(1) / period) * period
        high = np.floor(points[..., axis].max(1) / period) * period
        moved = points.copy()
        moved[..., axis] -= low[:, None]
        again = points[low != high].copy()
        again[..., axis] -= high[low != high][:, None]
        points, wide = np.concatenate([moved, again]), np.concatenate([wide, wide[low != high]])
    return points, wide
