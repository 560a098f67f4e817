"""What the functions of model files compute, slowly and in double precision: the twin of cpp/src/functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
UNIT = 64.0  # grey levels
QUIET, DAMPING = 1.0 / UNIT**2, 2.0 / UNIT**2


def brightness(view: Floats) -> Floats:
    """Map a view [3, H, W] to the brightness of its pairs of rows [H/2, W]."""
    return view.sum(axis=0).reshape(view.shape[1] // 2, 2, -1).sum(axis=1) / (6 * UNIT)


def rows_of(view: Floats) -> Floats:
    """Lay a view [3, H, W] out as rows [H, W/4, 12]."""
    return view.transpose(1, 2, 0).reshape(view.shape[1], view.shape[2] // 4, 12)


def read_views(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[Floats, Floats]:
    """Rows [2N, H, W/4, 12] and brightness [2N, 1, H/2, W] of views [N, 3, H, W]."""
    views = np.concatenate([left, right]).astype(np.float64)
    return np.stack([rows_of(view) for view in views]), np.stack([brightness(view)[None] for view in views])


def read_smaller(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> tuple[Floats, Floats]:
    """Do the same of views at three quarters of their width and height."""
    views = np.concatenate([left, right]).astype(np.float64)
    smaller = [stretched(view, view.shape[1] * 3 // 4, view.shape[2] * 3 // 4) for view in views]
    return np.stack([rows_of(view) for view in smaller]), np.stack([brightness(view)[None] for view in smaller])


def stretched(values: Floats, height: int, width: int) -> Floats:
    """Bring maps [..., h, w] to another size: bilinear between the middles of pixels, the border repeated."""
    for axis, length in ((-2, height), (-1, width)):
        before = values.shape[axis]
        place = np.clip((np.arange(length) + 0.5) * before / length - 0.5, 0, before - 1)
        base = np.minimum(place.astype(int), max(before - 2, 0))
        share = (place - base).reshape((-1, 1) if axis == -2 else (-1,))
        after = np.minimum(base + 1, before - 1)
        values = values.take(base, axis) * (1 - share) + values.take(after, axis) * share
    return values


def moments(left: Floats, right: Floats, disparity: Floats, cell: int) -> Floats:
    """Means over cells of slope, difference, their product and both squares, [5, H/cell, W/cell]."""
    height, width = left.shape
    shift = stretched(disparity, height, width)
    place = np.clip(np.arange(width) - shift, 0, width - 1)
    base = np.minimum(place.astype(int), width - 2)
    moved = np.stack([r[b] + (p - b) * (r[b + 1] - r[b]) for r, b, p in zip(right, base, place, strict=True)])
    both = np.pad(left + moved, ((0, 0), (1, 1)), mode="edge")
    slope, difference = (both[:, 2:] - both[:, :-2]) / 4, left - moved
    products = np.stack([slope, difference, slope * difference, slope**2, difference**2])
    return products.reshape(5, height * 2 // cell, cell // 2, width // cell, cell).mean(axis=(2, 4))


def step(means: Floats, reach: int) -> Floats:
    """Step, texture and mismatch [3, h, w] of windows that reach so many cells to each side."""
    _, height, width = means.shape
    seen = np.empty_like(means)
    for y in range(height):
        for x in range(width):
            rows, columns = slice(max(y - reach, 0), y + reach + 1), slice(max(x - reach, 0), x + reach + 1)
            seen[:, y, x] = means[:, rows, columns].mean(axis=(1, 2))
    slope, difference, product, slope2, difference2 = seen
    texture, mismatch = np.maximum(slope2 - slope**2, 0), np.maximum(difference2 - difference**2, 0)
    solved = np.clip((slope * difference - product) / (texture + DAMPING), -2, 2)
    return np.stack([solved, np.log(texture + QUIET) / 4, np.log(mismatch + QUIET) / 4])


def compare_views(bright: Floats, disparity: Floats, unit: float) -> tuple[Floats, Floats, Floats]:
    """Hints [N, 24, h, w], steps [N, 6, h, w] and spread [N, 2, h, w]; inputs [2N, 1, 2h, 4w] and [N, 1, h, w]."""
    count = len(disparity)
    found = [_compared(bright[i, 0], bright[count + i, 0], disparity[i, 0], unit) for i in range(count)]
    hints, steps, spread = (np.stack(maps) for maps in zip(*found, strict=True))
    return hints, steps, spread


def _compared(left: Floats, right: Floats, disparity: Floats, unit: float) -> tuple[Floats, Floats, Floats]:
    height, width = disparity.shape
    compared = moments(left, right, disparity, 2)
    cells = compared.reshape(5, height, 2, width, 2).mean(axis=(2, 4))
    fine = step(compared, 1).reshape(3, height, 2, width, 2).transpose(0, 2, 4, 1, 3).reshape(12, height, width)
    small, large = step(cells, 1), step(cells, 3)
    hints = [*fine, small[0], small[1], large[0], disparity / unit]
    surfaces = [surface[0, 0] for surface in extremes(disparity[None, None], 2)]
    for other in surfaces:
        hints += [(other - disparity) / 16, *step(moments(left, right, other, 4), 1)]
    return np.stack(hints), np.stack([*fine[:4], *surfaces]), small[1:]


def planes_around(planes: NDArray[np.uint8], pairs: int) -> tuple[NDArray[np.uint8]]:
    """Pairs of planes [N pairs, h, w, 2 C] with the plane before and the one after, [N pairs, h, w, 4 C]."""
    count, height, width, channels = planes.shape
    single = planes.reshape(-1, pairs, height, width, 2, channels // 2).transpose(0, 1, 4, 2, 3, 5)
    single = single.reshape(len(single), 2 * pairs, height, width, -1)
    wanted = (2 * np.arange(pairs)[:, None] + np.arange(-1, 3)).clip(0, 2 * pairs - 1)
    joined = single[:, wanted].transpose(0, 1, 3, 4, 2, 5)
    return (joined.reshape(count, height, width, 2 * channels),)


def answer_of_planes(cost: Floats, correction: Floats, dense: int, sparse: int, reach: int) -> tuple[Floats, Floats]:
    """Mean and excess variance [N, 1, 2h, 2w] of costs [N, 2, D/2, h w, 4] and their correction [N, h, w, 4 D]."""
    planes = dense + sparse
    count, height, width, _ = correction.shape
    order = np.concatenate([np.arange(0, planes, 2), np.arange(1, planes, 2)])
    moved = correction.reshape(count, height, width, planes, 4).transpose(0, 3, 1, 2, 4)
    both = cost.reshape(count, planes, height, width, 4) + moved
    value = np.where(order < dense, order, 2 * order - dense)[:, None, None, None].astype(np.float64)
    near = np.abs(order[:, None, None, None] - order[both.argmin(axis=1)][:, None]) <= (reach or planes)
    weight = np.exp(both.min(axis=1, keepdims=True) - both)
    total = weight.sum(axis=1)
    mean = (weight * value).sum(axis=1) / total
    gap = np.where(mean < dense, 1.0, 2.0) if sparse else 1.0
    fraction = (mean - dense) / gap % 1.0
    excess = (weight * value**2).sum(axis=1) / total - mean**2 - fraction * (1 - fraction) * gap**2
    answer = (weight * near * value).sum(axis=1) / (weight * near).sum(axis=1)
    return shuffled(answer), shuffled(np.maximum(excess, 0))


def shuffled(values: Floats) -> Floats:
    """Bring the four values of cells [N, h, w, 4] to a grid of twice the size, [N, 1, 2h, 2w]."""
    count, height, width, _ = values.shape
    return values.reshape(count, height, width, 2, 2).transpose(0, 1, 3, 2, 4).reshape(count, 1, 2 * height, 2 * width)


def choose_surface(correction: Floats, others: Floats, disparity: Floats, steps: Floats) -> tuple[Floats, ...]:
    """Answer, change and rough disparity [N, 1, 2h, 2w]; inputs as `ChooseSurface` of the networks has them."""

    def at_cells(values: Floats) -> Floats:
        return shuffled(values.transpose(0, 2, 3, 1))

    def gate(first: int) -> Floats:
        return 1 / (1 + np.exp(-at_cells(others[:, first : first + 4])))

    rough = stretched(disparity, 2 * disparity.shape[2], 2 * disparity.shape[3])
    near, far = (steps[:, i : i + 1].repeat(2, axis=2).repeat(2, axis=3) for i in (4, 5))
    change = at_cells(correction) + gate(0) * at_cells(steps[:, :4])
    change = change + gate(4) * (near - rough) + gate(8) * (far - rough)
    return np.maximum(rough + change, 0), change, rough


def match_evidence(disparity: Floats, excess: Floats, cell: float) -> tuple[Floats]:
    """Logarithms [N, 2, h, w] of excess variance and of the jump of the disparity around; inputs [N, 1, h, w]."""
    high, low = extremes(disparity, 1)
    return (np.log(np.concatenate([excess + 1e-3, (high - low) * cell + 0.1], axis=1)),)


def extremes(values: Floats, reach: int) -> tuple[Floats, Floats]:
    """Largest and smallest value of maps [N, 1, h, w] within squares that reach so many cells to each side."""
    padded = np.pad(values, ((0, 0), (0, 0), (reach, reach), (reach, reach)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1,) * 2, axis=(2, 3))
    return windows.max(axis=(4, 5)), windows.min(axis=(4, 5))


def clues_of_answer(
    hints: Floats, disparity: Floats, correction: Floats, change: Floats, unit: float
) -> tuple[Floats, Floats]:
    """Doubts [N, 2, h, w] and clues [N, 27, h, w]; inputs as `CluesOfAnswer` of the networks has them."""
    count, _, height, width = disparity.shape
    moved = np.abs(change).reshape(count, 1, height, 2, width, 2).max(axis=(3, 5))
    doubts = np.log(np.concatenate([np.abs(correction).max(axis=1, keepdims=True), moved], axis=1) + 0.05)
    near, wide = extremes(disparity, 2), extremes(disparity, 6)
    jumps = [np.log((high - low) / unit + 0.02) for high, low in (near, wide)]
    around = [disparity / unit, (near[0] - disparity) / unit, *jumps]
    return doubts, np.concatenate([hints[:, :15], *around, hints[:, 16:]], axis=1)


def scale_of_errors(evidence: Floats, clues: Floats, *weights: Floats) -> tuple[Floats]:
    """Logarithm [N, 1, h, w] of the scale of the errors; inputs as `ScaleOfErrors` of the networks has them."""
    first, bias, *layers, total = weights
    columns = np.concatenate([evidence, clues], axis=1)
    seen = np.maximum(np.einsum("oi,nihw->nohw", first[:, :, 0, 0], columns) + bias[:, None, None], 0)
    for i, distance in enumerate((1, 2, 4)):
        seen = np.maximum(convolved(seen, layers[2 * i], distance) + layers[2 * i + 1][:, None, None], 0)
    known = np.concatenate([evidence, seen], axis=1)
    return (np.clip(np.einsum("c,nchw->nhw", total[1:], known)[:, None] + total[0], -4.6, 4.6),)


def convolved(values: Floats, weights: Floats, distance: int) -> Floats:
    """Sums [N, O, h, w] over 3 x 3 cells of maps [N, I, h, w] that are so far apart; weights [O, I, 3, 3]."""
    height, width = values.shape[2:]
    padded = np.pad(values, ((0, 0), (0, 0), (distance, distance), (distance, distance)))
    shifted = [
        padded[:, :, y * distance : y * distance + height, x * distance : x * distance + width]
        for y in range(3)
        for x in range(3)
    ]
    return np.einsum("oit,tnihw->nohw", weights.reshape(*weights.shape[:2], 9), np.stack(shifted))


def volume_of_pairs(
    own: NDArray[np.uint8],
    own_scale: Floats,
    own_zero: Floats,
    other: NDArray[np.uint8],
    other_scale: Floats,
    other_zero: Floats,
    scale: Floats,
    zero: Floats,
    dense: int,
    sparse: int,
) -> tuple[Floats]:
    """Volume [N, P, h, w, 2 C], in 8 bits, of features [N, h, w, 2 C] of both views."""
    left, right = own_scale * (own - own_zero), other_scale * (other - other_zero)
    width, channels = own.shape[2], own.shape[3] // 2
    shifts = [(p, p, 0, 1) for p in range(dense // 2)]
    shifts += [(s, s + 1, 0, 0) for s in range(dense // 2, dense // 2 + sparse, 2)]
    volume = []
    for first, second, *places in shifts:
        parts = [
            right[:, :, np.maximum(np.arange(width) - shift, 0), place * channels : (place + 1) * channels]
            for shift, place in zip((first, second), places, strict=True)
        ]
        volume.append(np.maximum(left + np.concatenate(parts, axis=3), 0))
    return (np.clip(np.rint(np.stack(volume, axis=1) / scale) + zero, 0, 255),)


def thin_convolution(values: Floats, weights: Floats, bias: Floats) -> tuple[Floats]:
    """Convolution [N, 4, h, w] of values [N, C, h, w]; weights [4, C, 3, 3]."""
    return (convolved(values, weights, 1) + bias[:, None, None],)


def confidence_of_scale(log_scale: Floats) -> tuple[Floats]:
    """Confidence [N, 1, 2h, 2w] of the logarithm of the scale of the errors [N, 1, h, w]."""
    fine = stretched(log_scale, 2 * log_scale.shape[2], 2 * log_scale.shape[3])
    return (1 - np.exp(-np.exp(-fine)),)
