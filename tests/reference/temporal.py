"""The numpy twin of the temporal filter: what it must compute, written to be read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

PATCH, STEP, ITERATIONS, RIDGE = 8, 4, 4, 64.0
# Patches whose motion a pixel may take, in this order: the nearest, those around it, and the next along each axis.
NEARBY = [
    (0, 0),
    (-1, 0),
    (1, 0),
    (0, -1),
    (0, 1),
    (-1, -1),
    (1, 1),
    (1, -1),
    (-1, 1),
    (-2, 0),
    (2, 0),
    (0, -2),
    (0, 2),
]
Array = np.ndarray
Views = Sequence[Array]  # green and red


def neighbours(values: Array) -> Array:
    """The 3x3 values around each [9, h, w]; the edge stands in for what is beyond."""
    padded = np.pad(values, 1, mode="edge")
    h, w = values.shape
    return np.stack([padded[y : y + h, x : x + w] for y in range(3) for x in range(3)])


def sample(values: Array, x: Array, y: Array) -> Array:
    """Bilinear samples; positions outside take the nearest edge's value."""
    h, w = values.shape
    x, y = np.clip(x, 0, w - 1), np.clip(y, 0, h - 1)
    left, top = np.minimum(x.astype(int), max(w - 2, 0)), np.minimum(y.astype(int), max(h - 2, 0))
    right, bottom = np.minimum(left + 1, w - 1), np.minimum(top + 1, h - 1)
    upper = values[top, left] * (1 - x + left) + values[top, right] * (x - left)
    lower = values[bottom, left] * (1 - x + left) + values[bottom, right] * (x - left)
    return upper * (1 - y + top) + lower * (y - top)


def reduced(channel: Array, picture: tuple[int, int], unit: int) -> Array:
    """Means of squares of ``unit`` pixels."""
    h, w = picture[1] // unit, picture[0] // unit
    return channel[: h * unit, : w * unit].reshape(h, unit, w, unit).astype(float).mean(axis=(1, 3))


def pyramid(view: Array, picture: tuple[int, int]) -> tuple[list[Array], int]:
    """Green of uint8 [3, H, W] reduced to about 120 columns, halved twice while patches fit; and the reduction."""
    unit = max(1, int(picture[0] / 120 + 0.5))
    levels = [reduced(view[1], picture, unit)]
    while len(levels) < 3 and min(levels[-1].shape) >= 4 * PATCH:
        h, w = levels[-1].shape[0] // 2, levels[-1].shape[1] // 2
        levels.append(levels[-1][: 2 * h, : 2 * w].reshape(h, 2, w, 2).mean(axis=(1, 3)))
    return levels, unit


def motion(now: list[Array], before: list[Array]) -> tuple[Array, Array]:
    """Shift of every patch, along x and along y, by Lucas and Kanade's method from the coarsest level on."""
    shifts: tuple[Array, Array] | None = None
    for seen, former in zip(now[::-1], before[::-1], strict=True):
        h, w = ((side - PATCH) // STEP + 1 for side in seen.shape)
        start = np.zeros((h, w)), np.zeros((h, w))
        if shifts is not None:
            rows, columns = (
                np.clip((((np.arange(n) * STEP + 4) / 2 - 4) / STEP + 0.5).astype(int), 0, coarse - 1)
                for n, coarse in zip((h, w), shifts[0].shape, strict=True)
            )
            start = 2 * shifts[0][np.ix_(rows, columns)], 2 * shifts[1][np.ix_(rows, columns)]
        slope_y, slope_x = (np.zeros_like(seen) for _ in range(2))
        slope_x[:, 1:-1] = (seen[:, 2:] - seen[:, :-2]) / 2
        slope_y[1:-1] = (seen[2:] - seen[:-2]) / 2
        x, y = np.zeros((h, w)), np.zeros((h, w))
        for i, j in np.ndindex(h, w):
            rows, columns = np.mgrid[i * STEP : i * STEP + PATCH, j * STEP : j * STEP + PATCH]
            fixed, along_x, along_y = (part[rows, columns] for part in (seen, slope_x, slope_y))
            x[i, j], y[i, j] = follow(former, rows, columns, (fixed, along_x, along_y), start[0][i, j], start[1][i, j])
        shifts = np.median(neighbours(x), axis=0), np.median(neighbours(y), axis=0)
    assert shifts is not None
    return shifts


def follow(former: Array, rows: Array, columns: Array, patch: tuple, x0: float, y0: float) -> tuple[float, float]:
    """Where a patch was: four steps of Gauss and Newton; a shift that runs away is not taken."""
    fixed, along_x, along_y = (part - part.mean() for part in patch)
    normal = np.array([[(along_x**2).sum() + RIDGE, (along_x * along_y).sum()], [0, (along_y**2).sum() + RIDGE]])
    normal[1, 0] = normal[0, 1]
    shift = np.array([x0, y0])
    for _ in range(ITERATIONS):
        found = sample(former, columns + shift[0], rows + shift[1])
        difference = found - found.mean() - fixed
        shift = shift - np.linalg.solve(normal, [(along_x * difference).sum(), (along_y * difference).sum()])
    return tuple(shift) if np.abs(shift - (x0, y0)).max() <= PATCH / 2 else (x0, y0)


def shift_at(shifts: tuple[Array, Array], x: Array, y: Array) -> tuple[Array, Array]:
    """Shifts at places of level 0, between those of the patches."""
    at_x, at_y = (x - (PATCH - 1) / 2) / STEP, (y - (PATCH - 1) / 2) / STEP
    return sample(shifts[0], at_x, at_y), sample(shifts[1], at_x, at_y)


def ramp(value: Array, full: Array | float, none: Array | float) -> Array:
    return np.clip((none - value) / (none - full), 0, 1)


class TemporalFilter:
    def __init__(self) -> None:
        self.former: tuple[list[Array], Array, Array, Array] | None = None
        self.rate = np.zeros(5)  # of the camera's change

    def smooth(
        self, view: Array, picture: tuple[int, int], disparity: Array, confidence: Array, cells_per_pixel: float
    ) -> Array:
        """Disparity [h, w] drawn towards that of the frame before."""
        levels, unit = pyramid(view, picture)
        red = reduced(view[0], picture, unit)
        out = disparity.astype(float)
        error = np.clip(-1 / np.log(1 - np.clip(confidence.astype(float), 0.01, 0.99)), 0.8, 6)
        variance = error**2
        if self.former is not None:
            before, red_before, former, former_variance = self.former
            shifts = motion(levels, before)
            agreement, seen_x, seen_y = compare((levels[0], red), (before[0], red_before), shifts)
            per_cell = 1 / (cells_per_pixel * unit)
            rows, columns = np.mgrid[: out.shape[0], : out.shape[1]]
            x, y = (columns + 0.5) * per_cell - 0.5, (rows + 0.5) * per_cell - 0.5
            h, w = agreement.shape
            seen = np.clip((y + 0.5).astype(int), 0, h - 1), np.clip((x + 0.5).astype(int), 0, w - 1)
            gate, shift_x, shift_y = agreement[seen], seen_x[seen], seen_y[seen]
            from_x, from_y = columns + shift_x / per_cell, rows + shift_y / per_cell
            moved, moved_variance = sample(former, from_x, from_y), sample(former_variance, from_x, from_y)
            moved = moved + self.camera_change(moved, out - moved, gate, error)
            moved = moved + change_nearby(moved, out - moved, gate, error)
            uncertain = moved_variance + 0.02 * variance
            reach = np.sqrt(variance + uncertain)
            trust = gate * ramp(np.abs(out - moved), 8 * reach, 16 * reach)
            share = np.maximum(0.07, uncertain / (uncertain + variance))
            out = out - (1 - share) * trust * (out - moved)
            variance = variance * (1 - trust * (1 - share))
        self.former = levels, red, out, variance
        return out

    def camera_change(self, moved: Array, difference: Array, gate: Array, error: Array) -> Array:
        """The part of the change of disparity that the motion of the camera explains, followed as a rate."""
        h, w = moved.shape
        y, x = np.mgrid[:h, :w]
        x, y = (2 * x + 1) / w - 1, (2 * y + 1) / h - 1
        weight = gate * ramp(np.abs(difference), 8 * error, 16 * error) / error
        total, *means = sums([weight, *(weight * part for part in (difference, moved, x, y))])
        enough = total >= 8
        if not enough.any():
            self.rate = np.zeros(5)
            return np.zeros_like(moved)
        target, *place = (part[enough] / total[enough] for part in means)
        terms = camera_terms(*place)
        target = target - terms @ self.rate
        shares = total[enough] / (1 + 5 * (terms**2).sum(axis=-1))
        found = np.zeros(5)
        for _ in range(6):
            left = target - terms @ found
            reach = np.clip(3 * np.sort(np.abs(left))[left.size // 2], 0.01, 3)
            kept = shares * np.maximum(0, 1 - (left / reach) ** 2) ** 2
            found = np.linalg.solve(terms.T @ (terms * kept[:, None]) + np.eye(5), terms.T @ (kept * target))
        square = (shares * (terms @ found) ** 2).sum() / shares.sum()
        change = self.rate + max(0.5, square / (square + 0.06**2)) * found
        self.rate = self.rate + 0.3 * found
        return camera_terms(moved, x, y) @ change


def inside(shape: tuple[int, int], x: Array, y: Array) -> Array:
    return (x >= -0.5) & (x <= shape[1] - 0.5) & (y >= -0.5) & (y <= shape[0] - 0.5)


def compare(now: Views, before: Views, shifts: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """How far the pictures say that a place shows what it showed before, 0..1; and each pixel's shift to there."""
    h, w = now[0].shape
    y, x = np.mgrid[:h, :w]
    shift_x, shift_y = shift_at(shifts, x, y)
    there = inside((h, w), x + shift_x, y + shift_y)
    moved = [sample(view, x + shift_x, y + shift_y) for view in before]
    gains = [view[there].sum() / max(former[there].sum(), 1e-6) for view, former in zip(now, moved, strict=True)]

    def apart(seen: Views, was: Views) -> Array:
        """Of both colours, what differs more."""
        return np.max([np.abs(one - gain * two) for one, two, gain in zip(seen, was, gains, strict=True)], axis=0)

    residual = neighbours(apart(now, moved)).mean(axis=0)
    middle = np.sort(residual, axis=None)[residual.size // 2]
    if middle > 16:  # another scene
        return np.zeros((h, w)), shift_x, shift_y
    noise = np.clip(middle, 0.5, 4)
    residual = np.where(there, residual, np.inf)
    unlike = residual > 2.5 * noise
    patch_y, patch_x = (np.floor((place - (PATCH - 1) / 2) / STEP + 0.5).astype(int) for place in (y, x))
    around_y, around_x = (
        np.stack([np.clip(place + step, 0, size - 1) for step in steps])
        for place, size, steps in ((y, h, np.repeat([-1, 0, 1], 3)), (x, w, np.tile([-1, 0, 1], 3)))
    )
    for along_x, along_y in NEARBY:
        at = tuple(
            np.clip(part + along, 0, n - 1)
            for part, along, n in zip((patch_y, patch_x), (along_y, along_x), shifts[0].shape, strict=True)
        )
        other_x, other_y = shifts[0][at], shifts[1][at]
        was = [sample(view, around_x + other_x, around_y + other_y) for view in before]
        found = apart([view[around_y, around_x] for view in now], was).mean(axis=0)
        better = unlike & inside((h, w), x + other_x, y + other_y) & (found < residual)
        residual = np.where(better, found, residual)
        shift_x, shift_y = np.where(better, other_x, shift_x), np.where(better, other_y, shift_y)
    return ramp(residual, 2.5 * noise, 5 * noise), shift_x, shift_y


def sums(parts: Sequence[Array]) -> Array:
    """Sums over blocks of 8 x 8 cells [n, h, w]."""
    h, w = parts[0].shape
    room = (0, -h % 8), (0, -w % 8)
    return np.stack([np.pad(part, room).reshape((h + 7) // 8, 8, -1, 8).sum(axis=(1, 3)) for part in parts])


def camera_terms(d: Array, x: Array, y: Array) -> Array:
    """What moving along and turning about the axes change, in a last axis of five."""
    d = d / 32
    return np.stack([np.ones_like(d), d, d * x, d * y, d * d], axis=-1)


def change_nearby(moved: Array, difference: Array, gate: Array, error: Array) -> Array:
    """The part of the change that blocks of 8 x 8 cells share with others on their surface, if it is no noise."""
    h, w = difference.shape
    weight = gate * ramp(np.abs(difference), 8 * error, 16 * error) / error
    parts = sums((weight, weight * difference, weight * error, weight * moved))
    total, change, noise, place = (neighbours(part) for part in parts)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.abs(place / total - parts[3] / parts[0])
    share = np.where((total > 0) & (parts[0] > 0), ramp(apart, 2, 4), 0)
    total, change, noise = ((share * part).sum(axis=0) for part in (total, change, noise))
    change, limit = change / (total + 4), 0.1 * noise / (total + 4)
    change = np.sign(change) * np.maximum(0, np.abs(change) - limit)
    y, x = np.mgrid[:h, :w]
    return sample(change, (x + 0.5) / 8 - 0.5, (y + 0.5) / 8 - 0.5)
