"""The slow NumPy twin of the rig measured from what is left across the rows, written to be read."""

from __future__ import annotations

import numpy as np

from tests.reference.matched_views import gain_of_views
from tests.reference.view_measures import brightness, noise, seen_cells

POSE_PRIOR = np.array([0.1, 0.1, 0.1, 0.01, 0.01, 0.03])


def pose_rows(x: np.ndarray, y: np.ndarray, disparity: np.ndarray, pattern: tuple) -> np.ndarray:
    """Rows, px, by which the match of (x, y) lies lower per unit of turn (x, y, z), baseline and scale: [..., 6]."""
    fx, fy, cx, cy, doffs = pattern
    metric = (disparity + doffs) / fx
    u, v = (x - cx) / fx - metric, (y - cy) / fy
    terms = -fy * (1 + v * v), fy * u * v, fy * u, fy * metric, -fy * v * metric, fy * v
    return np.stack(np.broadcast_arrays(*terms), axis=-1)


def row_steps(
    here: np.ndarray,
    there: np.ndarray,
    gain: float,
    found: np.ndarray,
    wanted: np.ndarray,
    offset: np.ndarray,
    row: int,
    cell: int,
) -> tuple[float, float] | None:
    """A Lucas-Kanade step along y, rows, and its information, in the window of three rows of three cells around one."""
    points = []
    for y in (row - 1, row, row + 1):
        for c in (cell - 1, cell, cell + 1):
            if c >= found.shape[1] or not wanted[y, c]:
                return None
            at, lower = 2 * c - found[y, c], y + offset[row, c]
            if not (0 <= at <= here.shape[1] - 1 and 0 <= lower <= here.shape[0] - 1):
                return None
            column, line = min(int(at), here.shape[1] - 2), min(int(lower), here.shape[0] - 2)
            along, down = at - column, lower - line
            upper, under = there[line : line + 2, column : column + 2] @ [1 - along, along]
            levels = here[y, 2 * c], upper + down * (under - upper)
            if min(levels) <= 6 or max(levels) >= 245:
                return None
            gx = (here[y, 2 * c + 1] - here[y, 2 * c - 1]) / 2
            gy = (here[y + 1, 2 * c] - here[y - 1, 2 * c]) / 2
            points.append((gx, gy, levels[0] - gain * levels[1]))
    centred = np.array(points) - np.mean(points, axis=0)
    products = centred.T @ centred
    xx, xy, yy = products[0, 0] + 0.1, products[0, 1], products[1, 1]
    determinant = xx * yy - xy * xy
    return (xx * products[1, 2] - xy * products[0, 2]) / determinant, determinant / xx


def _robust(size: np.ndarray, tuned: float, cut: bool) -> np.ndarray:
    if not cut:
        return np.minimum(1, 1.345 * tuned / np.maximum(size, 1e-12))
    return np.clip(1 - (size / (4.685 * tuned)) ** 2, 0, None) ** 2


def _refined(value: np.ndarray, rows: np.ndarray, rest: np.ndarray, weight: np.ndarray) -> tuple:
    """One fit of the pose: value, the step taken, the normal matrix and the scatter."""
    step = np.zeros(6)
    for again in range(3):
        size = np.abs(rest - rows @ step)
        some = np.sort(size[:: len(size) // 512 + 1])
        tuned = max(1.4826 * some[len(some) // 2], 0.02)
        w = weight * _robust(size, tuned, again > 0)
        normal = (rows * w[:, None]).T @ rows / tuned**2 + np.diag(1 / POSE_PRIOR**2)
        step = np.linalg.solve(normal, (rows * w[:, None]).T @ rest / tuned**2 - value / POSE_PRIOR**2)
    return value + step, step, normal, tuned


def rig_error(
    disparity: np.ndarray,
    confidence: np.ndarray,
    left: np.ndarray,
    right: np.ndarray,
    picture: tuple[int, int],
    frame: tuple[float, float],
    pattern: tuple,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Turns, baseline directions and scale that explain what is left across the rows, and their covariance.

    ``picture`` is (width, height) of what is no padding, ``frame`` the frame's pixels per pixel of the views, along x
    and y; ``pattern`` focal lengths, principal point and doffs in the frame's pixels.
    """
    here, unit = brightness(left, picture[1], picture[0])
    there, _ = brightness(right, picture[1], picture[0])
    height, cells = here.shape[0], here.shape[1] // 2
    at = [
        np.minimum(((2 * np.arange(count) + 1) * unit * grid / view).astype(int), grid - 1)
        for count, grid, view in zip((height, cells), disparity.shape, left.shape[1:], strict=True)
    ]
    found = disparity[at[0]][:, at[1]] / unit
    wanted = confidence[at[0]][:, at[1]] >= 0.5
    deviation = max(noise(view, seen_cells(view, picture[1], picture[0]), unit) for view in (left, right))
    flat = 2 + 9 * deviation**2 / (8 * unit**2)
    across, down = unit * frame[0], 2 * unit * frame[1]
    x, y = (2 * np.arange(cells) + 0.5) * across - 0.5, (np.arange(height) + 0.5) * down - 0.5
    terms = pose_rows(x[None, :], y[:, None], across * found, pattern)
    bands, along = range((height - 5) // 6 + 1), (cells - 1) // 2
    gain = gain_of_views(disparity, left, right, picture[1], picture[0])
    value = np.zeros(6)
    every, passes = 3, 0
    while True:
        offset = terms @ value / down
        rows, rest, weight, block = [], [], [], []
        for band in (b for b in bands if b % every == every // 2 or len(bands) < every):
            row = 2 + 6 * band
            for i in range(along):
                step = row_steps(here, there, gain, found, wanted, offset, row, 2 * i + 1)
                if step is None or step[1] <= flat or abs(step[0]) >= 2:
                    continue
                rows.append(terms[row, 2 * i + 1])
                rest.append(step[0] * down)
                weight.append(step[1] / (step[1] + 20))
                block.append(band * 6 // len(bands) * 8 + i * 8 // along)
        if len(rows) < 100 or len(set(block)) < 6:
            return None
        fit = np.array(rows), np.array(rest), np.array(weight)
        before, (value, step, normal, tuned) = value, _refined(value, *fit)
        passes += 1
        if every == 1:
            break
        if passes == 6 or np.abs(value - before)[:3].max() < 0.0005:
            every = 1
    left_over = fit[1] - fit[0] @ step
    pulls = fit[0] * (fit[2] * _robust(np.abs(left_over), tuned, True) * left_over / tuned**2)[:, None]
    sums = np.array([pulls[np.array(block) == each].sum(axis=0) for each in set(block)])
    middle = sums.T @ sums * len(sums) / (len(sums) - 1) + np.diag(1 / POSE_PRIOR**2)
    bread = np.linalg.inv(normal)
    common = np.diag((0.03 * value) ** 2 + 1e-8)
    factor = np.array([1.1, 2.0, 1.5, 2.0, 2.0, 2.0])
    return value, np.outer(factor, factor) * (bread @ middle @ bread) + common
