"""Slow NumPy twins of what two views tell: brightness, noise, field of view, faults; written to be read."""

from __future__ import annotations

import numpy as np


def brightness(view: np.ndarray, height: int, width: int) -> tuple[np.ndarray, int]:
    """Brightness of the part of a planar view that is no padding, and pixels per column: a row for each two columns."""
    unit = max(1, (width + 240) // 480)
    rows, columns = height // (2 * unit), width // (2 * unit) * 2
    weights = np.array([0.25, 0.5, 0.25])
    gray = np.tensordot(weights, view[:, : rows * 2 * unit, : columns * unit].astype(float), 1)
    if not gray.size:
        return gray, unit
    means = gray.reshape(rows, 2 * unit, columns, unit).mean(axis=(1, 3))
    wide = np.pad(means, ((0, 0), (1, 1)), "edge")
    return (wide[:, :-2] + 2 * wide[:, 1:-1] + wide[:, 2:]) / 4, unit


def noise(view: np.ndarray, inside: np.ndarray, unit: int) -> float:
    """Standard deviation of the noise of one channel, from the median of the picture's mixed second difference.

    Only cells ``inside`` count.
    """
    height, width = (2 * unit * cells for cells in inside.shape)
    green = view[1, :height, :width].astype(int)
    along = green[:, :-2] - 2 * green[:, 1:-1] + green[:, 2:]
    differences = np.abs(along[:-2] - 2 * along[1:-1] + along[2:])[:: 4 * unit, :: 2 * unit]
    rows = (1 + 4 * unit * np.arange(differences.shape[0])) // (2 * unit)
    columns = 1 + 2 * unit * np.arange(differences.shape[1])
    values = differences[inside[rows][:, columns // (2 * unit)] & inside[rows][:, (columns + 1) // (2 * unit)]]
    if values.size == 0:
        return 0.0
    middle = int(np.sort(values)[(values.size - 1) // 2])
    below, here = np.count_nonzero(values < middle), np.count_nonzero(values == middle)
    return (middle + (values.size / 2 - below) / here - (0.5 if middle else 0.0)) / (6 * 0.6745)


def cell_levels(view: np.ndarray, height: int, width: int) -> np.ndarray:
    """Grey levels of cells, each two columns of brightness wide."""
    columns, _ = brightness(view, height, width)
    return (columns[:, ::2] + columns[:, 1::2]) / 2


def _joined(takes: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The cells of ``takes`` that are joined to those of ``start``, side by side."""
    found = start & takes
    while True:
        wide = np.pad(found, 1)
        grown = (wide[1:-1, 1:-1] | wide[:-2, 1:-1] | wide[2:, 1:-1] | wide[1:-1, :-2] | wide[1:-1, 2:]) & takes
        if (grown == found).all():
            return found
        found = grown


def field_of_view(levels: np.ndarray) -> np.ndarray | None:
    """The cells that the optics fill, bool; None where that is all of them."""
    height, width = levels.shape
    border = np.zeros(levels.shape, bool)
    border[[0, -1]] = border[:, [0, -1]] = True
    dark = np.sort(levels[border & (levels < 24)])
    if dark.size == 0 or dark.size < 0.02 * border.sum():
        return None
    base = dark[dark.size // 2]
    outside = _joined(levels <= base + 4, border)
    steps = []
    for y, x in np.argwhere(outside):
        for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            v, u = y + 2 * dy, x + 2 * dx
            if 0 <= v < height and 0 <= u < width and not outside[y + dy, x + dx] and not outside[v, u]:
                steps.append(levels[v, u] - base)
    if not steps or sorted(steps)[len(steps) // 2] < 8:
        return None
    rest = ~outside
    parts = []
    while rest.any():
        start = np.zeros(levels.shape, bool)
        start[tuple(np.argwhere(rest)[0])] = True
        parts.append(_joined(rest, start))
        rest &= ~parts[-1]
    largest = max(parts, key=np.count_nonzero, default=rest)
    if largest.sum() < 0.1 * largest.size:
        return None
    kept = np.flatnonzero(largest.any(axis=1))
    first, last = largest[kept].argmax(axis=1), width - 1 - largest[kept, ::-1].argmax(axis=1)
    inside = np.zeros(levels.shape, bool)
    for y in range(kept[0], kept[-1] + 1):
        # The line between any row above and any below, where it crosses this one.
        above, below = kept <= y, kept >= y
        a, b = kept[above][:, None], kept[below][None]
        share = (y - a) / np.maximum(b - a, 1)
        left = (first[above][:, None] + (first[below][None] - first[above][:, None]) * share).min()
        right = (last[above][:, None] + (last[below][None] - last[above][:, None]) * share).max()
        inside[y, int(np.ceil(left - 1e-9)) : int(np.floor(right + 1e-9)) + 1] = True
    if inside.mean() > 1 - 0.005 or (~inside & ~outside).sum() > 0.08 * (~inside).sum():
        return None
    return inside


def seen_cells(view: np.ndarray, height: int, width: int) -> np.ndarray:
    """The cells of a planar view that lie in its field of view, bool; all where no field was found."""
    levels = cell_levels(view, height, width)
    field = field_of_view(levels) if levels.size else None
    return np.ones(levels.shape, bool) if field is None else field


def deep_inside(inside: np.ndarray, cells: int) -> np.ndarray:
    """The cells at least so many, down or along, from a field's edge; the border of the picture is no edge."""
    height, width = inside.shape
    wide = np.pad(inside, cells, constant_values=True)
    deep = inside.copy()
    for y, x in np.ndindex(2 * cells + 1, 2 * cells + 1):
        deep &= wide[y : y + height, x : x + width]
    return deep


def view_measures(left: np.ndarray, right: np.ndarray, height: int, width: int, found: np.ndarray) -> dict[str, float]:
    """What two planar views tell: level, saturated, covered, blur; see view_measures.hpp.

    ``found`` is the disparity of each cell, columns; NaN where cells are not compared.
    """
    planes = [brightness(view, height, width) for view in (left, right)]
    unit = planes[0][1]
    columns = [plane for plane, _ in planes]
    cells = [cell_levels(view, height, width) for view in (left, right)]
    inside = [seen_cells(view, height, width) for view in (left, right)]
    noises = [noise(view, i, unit) ** 2 * 6 / 16 / (2 * unit**2) for view, i in zip((left, right), inside, strict=True)]
    tiles = [_tiles(cell, mask, 0.4 + 3 * n * 10 / 32) for cell, mask, n in zip(cells, inside, noises, strict=True)]
    return {
        "level": min(cell[mask].mean() for cell, mask in zip(cells, inside, strict=True)),
        "saturated": max((cell[mask] >= 245).mean() for cell, mask in zip(cells, inside, strict=True)),
        "covered": _covered(tiles, found),
        "blur": _blur(columns, inside, noises) * unit * 1000 / width,
    }


def _tiles(cells: np.ndarray, inside: np.ndarray, limit: float) -> np.ndarray:
    """Of tiles of 8 x 8 cells: 2 with texture, 1 flat, 0 not in the field of view."""
    rows, columns = cells.shape[0] // 8, cells.shape[1] // 8
    kinds = np.zeros((rows, columns), int)
    y, x = np.indices((8, 8)) - 3.5
    plane = np.stack([np.ones(64), y.ravel(), x.ravel()], 1)
    for row, column in np.ndindex(rows, columns):
        block = slice(8 * row, 8 * row + 8), slice(8 * column, 8 * column + 8)
        if inside[block][::7, ::7].all():
            values = cells[block].ravel()
            rest = values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0]
            kinds[row, column] = 2 if (rest**2).mean() > limit else 1
    return kinds


def _covered(tiles: list[np.ndarray], found: np.ndarray) -> float:
    """Share of the tiles with texture of one view whose match is flat, as are the tiles beside it; the larger share."""
    counts, missing = [0, 0], [0, 0]
    for row, column in np.ndindex(tiles[0].shape):
        match = 8 * column + 4 - found[8 * row + 4, 8 * column + 4] / 2
        if not 0 <= match < 8 * tiles[0].shape[1]:
            continue
        places = column, int(match) // 8
        for view, (here, there) in enumerate((tiles, tiles[::-1])):
            own, other = places[view], places[1 - view]
            if here[row, own] == 2 and there[row, other] != 0:
                counts[view] += 1
                beside = there[row, max(0, other - 1) : other + 2]
                missing[view] += there[row, other] == 1 and (beside != 2).all()
    shares = [lost / count for lost, count in zip(missing, counts, strict=True) if count >= 12]
    return max(shares, default=np.nan)


def _blur(columns: list[np.ndarray], inside: list[np.ndarray], noises: list[float]) -> float:
    """Standard deviation, columns, of the Gaussian that makes the sharper view as soft as the other one.

    Both views count without the edge of their field, and what lies beyond it is not blurred into them.
    """
    deep = [deep_inside(mask, 4) for mask in inside]

    def sharpness(view: int, passes: int) -> float:
        rows = columns[view][2::4].copy()
        mask = np.repeat(deep[view][2::4], 2, axis=1)
        within = mask & np.pad(mask[:, :-1], ((0, 0), (1, 0))) & np.pad(mask[:, 1:], ((0, 0), (0, 1)))
        for _ in range(passes):
            wide = np.pad(rows, ((0, 0), (1, 1)))
            rows = np.where(within, (wide[:, :-2] + wide[:, 2:]) / 4 + rows / 2, rows)
        both = mask[:, :-8] & mask[:, 8:]
        mask_row = np.array([1.0])
        for _ in range(passes + 1):
            mask_row = np.convolve(mask_row, [0.25, 0.5, 0.25])
        shares = np.correlate(mask_row, mask_row, "full")
        middle = shares.size // 2
        left = [noises[view] * 2 * (shares[middle] - (shares[middle + d] if d <= middle else 0)) for d in (2, 8)]
        near, wide = rows[:, 5:-3] - rows[:, 3:-5], rows[:, 8:] - rows[:, :-8]
        texture = (wide[both] ** 2).mean() - left[1]
        if not texture > 2 * noises[view]:
            return np.nan
        return max(0.0, (near[both] ** 2).mean() - left[0]) / texture

    sharp = [sharpness(view, 0) for view in (0, 1)]
    if np.isnan(sharp).any():
        return np.nan
    sharper = 0 if sharp[0] > sharp[1] else 1
    before, wanted = sharp[sharper], sharp[1 - sharper]
    for passes in range(1, 25):
        here = sharpness(sharper, passes)
        if np.isnan(here):  # nothing but noise is left: it takes at least this much to be as soft as the other view
            return float(np.sqrt(0.5 * (passes - 1)))
        if here <= wanted:
            return float(np.sqrt(0.5 * min(24, passes - 1 + (before - wanted) / max(1e-9, before - here))))
        before = here
    return float(np.sqrt(0.5 * 24))


def _tile(frame: np.ndarray, x: int, y: int, unit: int) -> np.ndarray:
    """12 x 12 means of blocks of the middle channel, about their own mean; of at most 4 x 4 pixels of a block."""
    channel = frame if frame.ndim == 2 else frame[..., 1]
    taken = np.arange(min(unit, 4)) * max(1, unit // 4)
    rows, columns = ((at + unit * np.arange(12))[:, None] + taken for at in (y, x))
    blocks = channel[rows[:, :, None, None], columns[None, None]].astype(float).mean(axis=(1, 3))
    return np.asarray(blocks - blocks.mean())


def _compared(left: np.ndarray, right: np.ndarray) -> tuple[float, float]:
    """Variance of the tile with more of it, and how far apart two tiles show their texture, blocks squared."""
    varies = [np.mean(tile**2) for tile in (left, right)]
    together = np.mean(left * right)
    if together <= 0:
        return max(varies), np.inf
    noises = []
    for tile, variance in zip((left, right), varies, strict=True):
        along = tile[:-2] - 2 * tile[1:-1] + tile[2:]
        mixed = along[:, :-2] - 2 * along[:, 1:-1] + along[:, 2:]
        noises.append(min(np.mean(mixed**2) / 36, 0.3 * variance))
    gain = together / (varies[0] - noises[0])
    differs = max(0.0, varies[1] - noises[1] - gain * together)
    if differs == 0:
        return max(varies), 0.0
    steep = np.mean(((left[:, 2:] - left[:, :-2]) / 2) ** 2)
    return max(varies), differs / (gain**2 * max(steep - noises[0] / 2, 0.1 * steep))


def displacement_of_frames(left: np.ndarray, right: np.ndarray) -> tuple[float, float]:
    """How far apart two frames show their texture, thousandths of the width: in tiles with more of it, in the rest."""
    height, width = left.shape[:2]
    unit = max(1, (width + 240) // 480)
    places = [(size - 12 * unit) * np.arange(count) // (count - 1) for size, count in ((height, 12), (width, 16))]
    found = [_compared(*(_tile(view, x, y, unit) for view in (left, right))) for y in places[0] for x in places[1]]
    textured = sorted((tiles for tiles in found if tiles[0] >= 2), key=lambda tiles: -tiles[0])
    if len(textured) < 6:
        return float("nan"), float("nan")
    half = (len(textured) + 1) // 2
    medians = [np.sort([apart for _, apart in part])[len(part) // 2] for part in (textured[:half], textured[half:])]
    more, rest = (min(float(np.sqrt(median)) * unit * 1000 / width, 100.0) for median in medians)
    return more, rest
