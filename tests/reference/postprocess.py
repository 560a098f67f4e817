"""Slow NumPy twins of post-processing: reasons, expected errors and joint bilateral upsampling, written to be read."""

from __future__ import annotations

import numpy as np

from endosdk import _core
from endosdk._core import Reason


def reasons(
    disparity: np.ndarray,
    confidence: np.ndarray,
    *,
    min_confidence: float,
    image: np.ndarray | None = None,
    valid_left: np.ndarray | None = None,
    valid_right: np.ndarray | None = None,
    depth: np.ndarray | None = None,
    depth_range: tuple[float, float] = (0.0, np.inf),
    doffs: float = 0.0,
    disparity_begin: float = 0.0,
    disparity_end: float = np.inf,
    inside_left: np.ndarray | None = None,
) -> np.ndarray:
    """Reason bits of full-size float32 maps; with ``depth`` the range is tested, without it only the disparity.

    Up to ``disparity_begin``, px of these maps, an error is as large as the disparity; from ``disparity_end`` on, the
    network finds nothing.
    """
    height, width = disparity.shape
    finite = np.isfinite(disparity)
    x = np.arange(width, dtype=np.float32)
    match = np.where(finite, x - np.where(finite, disparity, 0), np.float32(np.inf)).astype(np.float32)
    bits = np.zeros((height, width), np.uint8)
    bits[~(confidence >= min_confidence)] |= Reason.LOW_CONFIDENCE.value
    for y in range(height):
        for column in range(width - 1):
            if finite[y, column] and match[y, column + 1 :].min() < match[y, column] - np.float32(1):
                bits[y, column] |= Reason.OCCLUDED.value
    inside = finite & (match >= 0) & (match <= width - 1)
    bits[finite & ~inside] |= Reason.OUTSIDE_OVERLAP.value
    if valid_left is not None:
        bits[valid_left == 0] |= Reason.OUTSIDE_OVERLAP.value
    if valid_right is not None:
        nearest = np.where(inside, match + np.float32(0.5), 0).astype(int)
        bits[inside & (np.take_along_axis(valid_right, nearest, axis=1) == 0)] |= Reason.OUTSIDE_OVERLAP.value
    if depth is None:
        usable = disparity > np.float32(disparity_begin)
    else:
        usable = disparity > np.float32(disparity_begin + max(0.0, -doffs))
        usable &= (depth >= depth_range[0]) & (depth <= depth_range[1])
        usable &= np.isfinite(depth) & (depth > 0)
    bits[~(usable & finite & (disparity < np.float32(disparity_end)))] |= Reason.OUT_OF_RANGE.value
    if image is not None:
        bits[(image[:, :height, :width] >= _core.saturation_level).all(axis=0)] |= Reason.SATURATED.value
    if inside_left is not None:
        bits[~inside_left] |= Reason.OUTSIDE_VIEW.value
    return bits


def confidence_within(confidence: np.ndarray, reach: np.ndarray | float) -> np.ndarray:
    """Chance of an error up to ``reach`` network pixels, by Laplace's law, of that up to one pixel."""
    # 2^-24: nothing of single precision lies nearer to 1.
    return 1 - (1 - np.clip(confidence.astype(np.float64), 0, 1 - 2.0**-24)) ** reach


def sigma(depth: np.ndarray, confidence: np.ndarray, *, focal_baseline: float, gain: float) -> np.ndarray:
    """Expected depth error in mm: a Laplace law whose chance of an error up to one network pixel is the confidence."""
    # The limits are those of single precision, which is what confidence comes in.
    clamped = np.clip(confidence, np.float32(1e-6), np.float32(1 - 1e-6)).astype(np.float64)
    scale = -1 / np.log1p(-clamped)
    return depth**2 / focal_baseline * gain * scale


def rig_sigma(
    depth: np.ndarray, sigma: np.ndarray, pose: np.ndarray, error: np.ndarray, *, focal_baseline: float, pattern: tuple
) -> np.ndarray:
    """Sigma, mm, with what the certain ones of the six terms of a pose error add, each with its standard error."""
    focal_x, focal_y, cx, cy, _ = pattern
    rows, columns = np.indices(depth.shape)
    u, v = (columns - cx) / focal_x, (rows - cy) / focal_y
    # The baseline's two terms move matches across the rows alone.
    moved = -focal_x * u * v, focal_x * (1 + u * u), -focal_x * v, 0.0, 0.0, focal_x * u
    certain = np.clip(np.abs(pose) / (2.5 * error) - 1, 0, 1) * np.square(np.abs(pose) + error)
    px = sum(variance * term**2 for variance, term in zip(certain, moved, strict=True))
    return np.sqrt(sigma**2 + (depth**2 / focal_baseline) ** 2 * px)


def joint_bilateral_upsampling(disparity: np.ndarray, confidence: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Disparity [h, w] of every pixel of ``view`` uint8 [3, H, W], which has H / h pixels per cell, float64 [H, W].

    Each pixel takes the mean of the cells less than three cells away, weighted by how near a cell lies (a tent), how
    much its mean colour is like the pixel's, and one over the scale of the Laplace law that its confidence tells.
    """
    h, w = disparity.shape
    factor = view.shape[1] // h
    colours = view.astype(np.float64)
    means = colours.reshape(3, h, factor, w, factor).mean(axis=(2, 4))
    known = np.nan_to_num(confidence, nan=0.0)
    trust = -np.log1p(-np.clip(known, np.float32(1e-6), np.float32(1 - 1e-6)).astype(np.float64))
    out = np.empty((h * factor, w * factor))
    for y, x in np.ndindex(out.shape):
        at_y, at_x = (y + 0.5) / factor - 0.5, (x + 0.5) / factor - 0.5
        weight = value = 0.0
        for cell_y in range(int(np.floor(at_y)) - 2, int(np.floor(at_y)) + 4):
            for cell_x in range(int(np.floor(at_x)) - 2, int(np.floor(at_x)) + 4):
                tent = max(0.0, 1 - abs(at_y - cell_y) / 3) * max(0.0, 1 - abs(at_x - cell_x) / 3)
                cell = min(max(cell_y, 0), h - 1), min(max(cell_x, 0), w - 1)  # the border stands in for what is beyond
                unlike = np.abs(means[:, cell[0], cell[1]] - colours[:, y, x]).sum()
                like = max(0.0, 1 - unlike / _core.upsampling_unlike) ** 4 + _core.upsampling_least_likeness
                counts = tent * like * trust[cell]
                weight += counts
                value += counts * disparity[cell]
        out[y, x] = value / weight
    return out
