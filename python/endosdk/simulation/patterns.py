"""What objects look like: pictures that tile, of leaves, noise, boards, stripes, dots, letters, or nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.noise import Array, fractal_tile, tile_noise

Picture = NDArray[np.uint8]
SIDE = 256
PATTERNS: dict[str, float] = {
    "leaves": 0.25,
    "noise": 0.22,
    "marble": 0.08,
    "checkers": 0.07,
    "dots": 0.06,
    "stripes": 0.06,
    "bricks": 0.05,
    "scribble": 0.08,
    "letters": 0.05,
    "plain": 0.08,
}


def draw_pattern(rng: np.random.Generator) -> tuple[str, Picture]:
    """Draw the name of a pattern and its picture, uint8 [256,256,3], which repeats without a seam."""
    name = str(rng.choice(list(PATTERNS), p=list(PATTERNS.values())))
    picture = _PAINT[name](rng)
    if rng.random() < 0.5:  # a little grain on everything: real surfaces have it
        grain = tile_noise(rng, (SIDE, SIDE), rng.uniform(2.5, 8.0))
        picture = picture * np.exp(rng.uniform(0.02, 0.2) * grain)[..., None]
    return name, np.clip(picture, 0, 255).astype(np.uint8)


def colour(rng: np.random.Generator) -> Array:
    """Draw a colour, sRGB 0..255; one in three is grey."""
    if rng.random() < 0.33:
        return np.full(3, rng.uniform(15, 245), np.float32)
    vivid = rng.uniform(10, 245, 3)
    return np.asarray(vivid + (vivid.mean() - vivid) * rng.uniform(0.0, 0.9), np.float32)


def _two(rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw two colours of which one is brighter by a random contrast."""
    first = colour(rng)
    if rng.random() < 0.3:
        return first, np.clip(first * rng.uniform(0.6, 0.9), 5, 250).astype(np.float32)
    return first, colour(rng)


def _mix(weight: Array, first: Array, second: Array) -> Array:
    return np.asarray(first + (second - first) * weight[..., None], np.float32)


def _grid() -> tuple[Array, Array]:
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32)
    return y, x


def _leaves(rng: np.random.Generator) -> Array:
    import cv2

    picture = np.empty((SIDE, SIDE, 3), np.float32)
    picture[:] = colour(rng)
    smallest = rng.uniform(2, 8)
    for _ in range(int(rng.integers(60, 220))):
        radius = smallest / max(float(rng.random()), 0.06)
        centre = rng.uniform(0, SIDE, 2)
        tone = tuple(colour(rng).tolist())
        corners = int(rng.integers(3, 7)) if rng.random() < 0.5 else 24
        turn = np.sort(rng.uniform(0, 2 * np.pi, corners)) if corners < 24 else np.linspace(0, 2 * np.pi, corners)
        outline = radius * np.stack([np.cos(turn), np.sin(turn) * rng.uniform(0.3, 1.0)], -1)
        # What leaves one side comes in at the other.
        for shift in np.array([[0, 0], [SIDE, 0], [0, SIDE], [SIDE, SIDE]]) - (centre > SIDE / 2) * SIDE:
            corners_px = np.rint((outline + centre + shift) * 16).astype(np.int32)
            cv2.fillPoly(picture, [corners_px], tone, lineType=cv2.LINE_AA, shift=4)
    return picture


def _noise(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    field = fractal_tile(rng, (SIDE, SIDE), rng.uniform(6, 90), 5, rng.uniform(0.4, 0.9))
    return _mix((0.5 + 0.5 * np.tanh(field * rng.uniform(0.4, 2.5))).astype(np.float32), first, second)


def _marble(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    field = fractal_tile(rng, (SIDE, SIDE), rng.uniform(30, 120), 4, 0.5)
    lines = np.exp(-((field / rng.uniform(0.05, 0.25)) ** 2)).astype(np.float32)
    return _mix(lines, first, second)


def _checkers(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    cells = 2 * int(rng.integers(2, 9))
    y, x = (np.floor(a * cells / SIDE) for a in _grid())
    return _mix(((x + y) % 2).astype(np.float32), first, second)


def _dots(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    cells = int(rng.integers(3, 14))
    y, x = (a * cells / SIDE % 1.0 - 0.5 for a in _grid())
    edge = SIDE / cells
    inside = np.clip((rng.uniform(0.15, 0.42) - np.hypot(x, y)) * edge + 0.5, 0, 1)
    return _mix(inside.astype(np.float32), first, second)


def _stripes(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    y, x = _grid()
    across, down = int(rng.integers(0, 14)), int(rng.integers(0, 14))
    if across + down == 0:
        across = 6
    phase = (x * across + y * down) / SIDE % 1.0
    return _mix((phase < rng.uniform(0.15, 0.85)).astype(np.float32), first, second)


def _bricks(rng: np.random.Generator) -> Array:
    first, second = _two(rng)
    rows = 2 * int(rng.integers(2, 7))
    columns = max(1, rows // 2)
    y, x = _grid()
    row = np.floor(y * rows / SIDE)
    place = x * columns / SIDE + 0.5 * (row % 2)
    mortar = rng.uniform(0.04, 0.15)
    joint = (y * rows / SIDE % 1.0 < 2 * mortar) | (place % 1.0 < mortar)
    tones = rng.uniform(0.6, 1.15, (rows, columns)).astype(np.float32)
    wall = first * tones[row.astype(int) % rows, np.floor(place).astype(int) % columns][..., None]
    return np.where(joint[..., None], second, wall).astype(np.float32)


def _scribble(rng: np.random.Generator) -> Array:
    import cv2

    picture = np.empty((SIDE, SIDE, 3), np.float32)
    picture[:] = colour(rng)
    for _ in range(int(rng.integers(5, 40))):
        steps = rng.normal(0, rng.uniform(4, 20), (int(rng.integers(4, 30)), 2))
        line = rng.uniform(0, SIDE, 2) + np.cumsum(steps, 0)
        tone = tuple(colour(rng).tolist())
        width = int(rng.integers(1, 6))
        for shift in ((0, 0), (SIDE, 0), (0, SIDE), (-SIDE, 0), (0, -SIDE)):
            cv2.polylines(picture, [np.rint(line + shift).astype(np.int32)], False, tone, width, cv2.LINE_AA)
    return picture


def _letters(rng: np.random.Generator) -> Array:
    import cv2

    picture = np.empty((SIDE, SIDE, 3), np.uint8)
    picture[:] = colour(rng)
    for _ in range(int(rng.integers(8, 40))):
        text = "".join(chr(int(k)) for k in rng.integers(33, 127, int(rng.integers(1, 8))))
        place = (int(rng.integers(-30, SIDE - 10)), int(rng.integers(8, SIDE)))
        font, size = int(rng.integers(0, 8)), float(rng.uniform(0.3, 1.6))
        cv2.putText(picture, text, place, font, size, tuple(colour(rng).tolist()), int(rng.integers(1, 3)), cv2.LINE_AA)
    return picture.astype(np.float32)


def _plain(rng: np.random.Generator) -> Array:
    picture = np.empty((SIDE, SIDE, 3), np.float32)
    picture[:] = colour(rng)
    return picture


_PAINT: dict[str, Callable[[np.random.Generator], Array]] = {
    "leaves": _leaves,
    "noise": _noise,
    "marble": _marble,
    "checkers": _checkers,
    "dots": _dots,
    "stripes": _stripes,
    "bricks": _bricks,
    "scribble": _scribble,
    "letters": _letters,
    "plain": _plain,
}
