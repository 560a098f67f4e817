"""Slow NumPy twins of comparing the views, at the disparity found and without one, written to be read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from endosdk import _core
from endosdk._core import Cause
from tests.reference.view_measures import brightness, cell_levels, deep_inside, noise, seen_cells

LEAST_CORRELATION = _core.cause_facts[Cause.VIEWS_DIFFER]["invalid"]
LEAST_TEXTURE = _core.cause_facts[Cause.LOW_TEXTURE]["invalid"]

FALLING = np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1])  # weights of a window
SMOOTHED = 6 / 16  # of the variance of noise, by the mask 1 2 1 of the brightness
GLARING = 225.0  # grey level from which a cell does not count
SUPPORTED = 0.3  # correlation from which the pictures fully support a match
EVEN_ODDS, FALL, GENTLE, RIM_ODDS = 45.0, 14.0, 3.0, 4.0


def placed(disparity: np.ndarray, fields: list[np.ndarray], size: tuple[int, int], unit: int) -> np.ndarray:
    """Disparity of each cell, columns; NaN where the cell or its match is not well inside its field of view.

    ``size`` is that of the views with their padding, px.
    """
    height, width = size
    rows, cells = fields[0].shape
    grid = disparity.shape
    y = np.minimum(((2 * np.arange(rows) + 1) * unit * grid[0] / height).astype(int), grid[0] - 1)
    x = np.minimum(((2 * np.arange(cells) + 1) * unit * grid[1] / width).astype(int), grid[1] - 1)
    found = disparity[y][:, x] / np.float32(unit)
    deep = [deep_inside(field, 1) for field in fields]
    found[~deep[0]] = np.nan
    if not fields[1].all():
        place = np.arange(cells) - found / 2
        first = np.where(deep[1].any(axis=1), deep[1].argmax(axis=1), cells)
        last = cells - 1 - deep[1][:, ::-1].argmax(axis=1)
        found[~((place >= first[:, None]) & (place <= last[:, None]))] = np.nan
    return found


class Matches(NamedTuple):
    """Both views in cells of 2 x 2 columns of brightness, the right one where it was matched."""

    here: np.ndarray
    there: np.ndarray
    counted: np.ndarray  # cells with a match and without glare
    found: np.ndarray  # disparity, columns
    noise: tuple[float, float]  # variance of a column of brightness
    unit: int  # pixels per column


def matches_of(disparity: np.ndarray, left: np.ndarray, right: np.ndarray, height: int, width: int) -> Matches:
    """Read the right view where the left one was matched; arguments as in `correlation_of_views`."""
    here, unit = brightness(left, height, width)
    there, _ = brightness(right, height, width)
    rows, cells = here.shape[0], here.shape[1] // 2
    views = (left, right)
    fields = [seen_cells(view, height, width) for view in views]
    own, other = (
        noise(view, field, unit) ** 2 * 6 / 16 / (2 * unit**2) for view, field in zip(views, fields, strict=True)
    )
    found = placed(disparity, fields, left.shape[1:], unit)
    match = 2 * np.arange(cells, dtype=np.float32) - found
    inside = (match >= 0) & (match <= here.shape[1] - 1)
    column = np.minimum(np.where(inside, match, 0).astype(int), here.shape[1] - 2)
    part = np.where(inside, match, 0) - column
    row = np.arange(rows)[:, None]
    matched = there[row, column] * (1 - part) + there[row, column + 1] * part
    counted = inside & (here[:, ::2] <= GLARING) & (matched <= GLARING)
    return Matches(here[:, ::2], matched, counted, found, (own, other), unit)


def gain_of_views(disparity: np.ndarray, left: np.ndarray, right: np.ndarray, height: int, width: int) -> float:
    """Contrast of the left view over that of the right one; arguments as in `correlation_of_views`."""
    seen = matches_of(disparity, left, right, height, width)
    some = slice(None, None, 8)
    weights = np.apply_along_axis(np.convolve, 1, np.ones(seen.here.shape), FALLING, "same")
    weights = (weights * seen.counted)[some]
    if not weights.any():
        return 1.0
    mean = [np.average(view[some], weights=weights) for view in (seen.here, seen.there)]
    varies = [
        np.average((view[some] - middle) ** 2, weights=weights) - noise * SMOOTHED
        for view, middle, noise in zip((seen.here, seen.there), mean, seen.noise, strict=True)
    ]
    return float(np.clip(np.sqrt(varies[0] / varies[1]), 0.25, 4)) if min(varies) > 4 else 1.0


def correlation_of_views(
    disparity: np.ndarray, left: np.ndarray, right: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Correlation of two views at the disparity found, what that leaves, the factor of jumps, pixels per column.

    What is left is a share of the confidence; the factor is one of its odds.

    The correlation is NaN where nothing can be compared.

    Grid float32 [h, w]; views uint8 [3, H, W], of which ``height`` x ``width`` px are no padding; one cell
    of the grid is H / h by W / w px. What is returned stands on cells of 2 x 2 columns.
    """
    here, unit = brightness(left, height, width)
    if not here.size:
        return np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)), unit
    here, matched, inside, found, noises, _ = matches_of(disparity, left, right, height, width)
    rows, cells = here.shape
    left_noise, right_noise = (SMOOTHED * noise for noise in noises)
    correlation, share, odds = np.full((rows, cells), np.nan), np.ones((rows, cells)), np.ones((rows, cells))
    flat = 0.3 + max(left_noise, right_noise)
    for row, cell in np.ndindex(rows, cells):
        window = slice(max(0, row - 5), row + 6), slice(max(0, cell - 5), cell + 6)
        seen = inside[window]
        weights = (
            FALLING[window[0].start - row + 5 :][: seen.shape[0], None]
            * FALLING[window[1].start - cell + 5 :][: seen.shape[1]]
        )[seen]
        if weights.sum() >= FALLING.sum() ** 2 / 4:
            a, b = (view - np.average(view, weights=weights) for view in (here[window][seen], matched[window][seen]))
            varies = np.average(a**2, weights=weights) - left_noise, np.average(b**2, weights=weights) - right_noise
            if max(varies) > flat:
                together = np.average(a * b, weights=weights)
                correlation[row, cell] = np.clip(together / np.sqrt(max(varies[0], flat) * max(varies[1], flat)), -1, 1)
                share[row, cell] = np.clip(correlation[row, cell] / SUPPORTED, 0, 1)
        inner, outer = (
            _spread(found[max(0, row - reach) : row + reach + 1, max(0, cell - reach) : cell + reach + 1])
            for reach in (1, 3)
        )
        if inner is not None:
            odds[row, cell] = EVEN_ODDS * np.exp(-FALL * inner / (outer + GENTLE))
        if np.isnan(found[max(0, row - 3) : row + 4, max(0, cell - 3) : cell + 4]).any():
            odds[row, cell] *= RIM_ODDS
    return correlation, share, odds, unit


def _spread(disparities: np.ndarray) -> float | None:
    """How far disparities lie apart, columns, up to a thousand; None where none is known."""
    known = disparities[~np.isnan(disparities)].astype(np.float64)
    if not known.size:
        return None
    with np.errstate(invalid="ignore"):
        apart = known.max() - known.min()
    return float(apart) if apart < 1000 else 1000.0


def supported_confidence(
    disparity: np.ndarray, confidence: np.ndarray, left: np.ndarray, right: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, bool]:
    """Confidence times the share that the pictures leave of it, and whether the views belong together."""
    correlation, share, odds, unit = correlation_of_views(disparity, left, right, height, width)
    textured = np.isfinite(correlation)
    if share.size == 0:
        return confidence, True
    seen = seen_cells(left, height, width)
    textured &= seen
    windows = max(1, textured.sum() / 79)
    if not textured.any():
        return np.zeros_like(confidence), False
    most = correlation[textured].mean() + 3.09 * correlation[textured].std() / np.sqrt(windows)
    if textured.sum() / seen.sum() < LEAST_TEXTURE or most < LEAST_CORRELATION:
        return np.zeros_like(confidence), False
    y, x = np.indices(confidence.shape) + 0.5
    rows = np.minimum((y * left.shape[1] / confidence.shape[0]).astype(int) // (2 * unit), share.shape[0] - 1)
    cells = np.minimum((x * left.shape[2] / confidence.shape[1]).astype(int) // (2 * unit), share.shape[1] - 1)
    factor = odds[rows, cells]
    return share[rows, cells] * factor * confidence / (1 + (factor - 1) * confidence), True


def coarse_match(left: np.ndarray, right: np.ndarray, picture: tuple[int, int]) -> tuple[float, float]:
    """How much better patches agree to their right than to their left, and the rows by which matches lie lower.

    Rows of brightness; not a number where all patches together do not agree clearly better there.
    """
    here, there = (cell_levels(view, picture[1], picture[0]) for view in (left, right))
    height, cells = here.shape
    longest, crossed, farthest = cells // 4, cells // 16, 10
    margin, edge = longest + 6, farthest + 4
    if cells <= 2 * margin or height <= 2 * edge:
        return np.nan, np.nan
    windows = np.lib.stride_tricks.sliding_window_view(there, (9, 11)).reshape(height - 8, cells - 10, -1)
    gains, likeness = [], []
    for j, i in np.ndindex(10, 10):
        x = margin + i * (cells - 1 - 2 * margin) // 9
        y = edge + j * (height - 1 - 2 * edge) // 9
        patch = here[y - 4 : y + 5, x - 5 : x + 6].ravel()
        if patch.var() <= 4:
            continue
        columns = slice(x - longest - 5, x + longest - 4)
        seen = np.stack([_correlations(patch, windows[y - 4 + row, columns]) for row in range(-farthest, farthest + 1)])
        gains.append(seen[farthest, longest + 1 :].max() - seen[farthest, :longest].max())
        likeness.append(np.arctanh(np.clip(seen[:, : longest + crossed + 1].max(axis=1), -0.95, 0.95)))
    if len(gains) < 16:
        return np.nan, np.nan
    return float(np.mean(gains)), _rows_off(np.array(likeness), farthest)


def share_of_rivals(left: np.ndarray, right: np.ndarray, picture: tuple[int, int]) -> float:
    """Share of the patches whose row holds a second match, five cells or more away, nearly as good as the best one."""
    here, there = (cell_levels(view, picture[1], picture[0]) for view in (left, right))
    height, cells = here.shape
    longest, crossed = cells // 4, cells // 16
    first, last = longest // 2 + 5, cells - 6
    if last <= first or height <= 8:
        return np.nan
    windows = np.lib.stride_tricks.sliding_window_view(there, (9, 11)).reshape(height - 8, cells - 10, -1)
    rivals = []
    for j, i in np.ndindex(10, 10):
        x, y = first + i * (last - first) // 9, 4 + j * (height - 9) // 9
        patch = here[y - 4 : y + 5, x - 5 : x + 6].ravel()
        if patch.var() <= 4:
            continue
        places = np.arange(max(5, x - longest), min(last, x + crossed) + 1)
        seen = _correlations(patch, windows[y - 4, places - 5])
        if seen.max() >= 0.6:
            near = seen > seen.max() - 0.03
            best = seen.argmax()
            sides = near[best:], near[best::-1]
            rivals.append(any(side[max(5, side.argmin()) :].any() for side in sides if not side.all()))
    return float(np.mean(rivals)) if len(rivals) >= 16 else np.nan


def _rows_off(likeness: np.ndarray, level: int) -> float:
    """The row [patch, row] on which all patches are most alike, from that at ``level`` on."""
    mean = likeness.mean(axis=0)
    best = int(mean.argmax())
    others = mean[np.abs(np.arange(len(mean)) - best) > 3].max()
    gain = likeness[:, best] - likeness[:, level]
    if best == level or mean[best] - others < 0.085 or gain.mean() < 2.5 * gain.std(ddof=1) / np.sqrt(len(gain)):
        return np.nan
    if not 0 < best < len(mean) - 1:
        return float(best - level)
    before, here, after = mean[best - 1 : best + 2]
    return float(best - level + (before - after) / 2 / (before - 2 * here + after))


def _correlations(patch: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Of a patch with others; 0 where those are flat."""
    here, there = patch - patch.mean(), others - others.mean(axis=1, keepdims=True)
    squares = (there**2).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(squares <= 2 * patch.size, 0.0, there @ here / np.sqrt((here**2).sum() * squares))
