"""Where surfaces end: pixels near a depth edge, and answers that hang between two surfaces.

Lengths are px of a frame 960 px wide and grow with the width, so that a scene has the same edges at every size. All
maps are [H, W]; truth that is not finite is no truth.
"""

from __future__ import annotations

import math

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.evaluation.metrics import Map, Mask, finite_or_nan

WIDTH = 960  # px: the width for which the following are stated
JUMP = 3.0  # px of disparity
NEIGHBOURS = 2.0  # px
BAND = 8.0  # px
BETWEEN = 3.0  # px of disparity


def depth_edges(truth: Map) -> Mask:
    """Return both ends of every depth edge.

    Two pixels of a row or a column, up to `NEIGHBOURS` apart (at least one pixel), are its ends when their true
    disparities differ by more than `JUMP`.
    """
    near, far = _ends(truth)
    return near | far


def edge_ends(truth: Map) -> Mask:
    """Return the nearer end of every depth edge alone."""
    return _ends(truth)[0]


def _ends(truth: Map) -> tuple[Mask, Mask]:
    """Return the nearer and the farther end of every depth edge."""
    factor, truth = truth.shape[1] / WIDTH, finite_or_nan(truth)
    near, far = np.zeros(truth.shape, np.bool_), np.zeros(truth.shape, np.bool_)
    for axis in (0, 1):
        values, nearer, farther = (np.moveaxis(given, axis, 0) for given in (truth, near, far))
        for step in range(1, _neighbours(factor) + 1):
            change = values[step:] - values[:-step]
            rises, falls = change > JUMP * factor, change < -JUMP * factor
            nearer[step:] |= rises
            farther[:-step] |= rises
            nearer[:-step] |= falls
            farther[step:] |= falls
    return near, far


def near_edges(truth: Map) -> Mask:
    """Return the pixels at most `BAND` away from an end of a depth edge."""
    return within_band(depth_edges(truth))


def within_band(ends: Mask) -> Mask:
    """Return the pixels at most `BAND` away from one of ``ends``."""
    import cv2

    if not ends.any():
        return ends
    away = cv2.distanceTransform((~ends).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away <= BAND * ends.shape[1] / WIDTH)


def flying_pixels(disparity: Map, truth: Map) -> Mask:
    """Return the pixels near a depth edge whose answer lies between foreground and background, where no surface is.

    Foreground and background are the largest and the smallest true disparity in the square around the pixel that holds
    everything within `BAND` and both ends of the edge. An answer between them is a flying pixel when it is more than
    `BETWEEN` away from every true disparity of that square: one that belongs to a neighbouring surface is misplaced,
    but does not fly. Pixels without truth of their own, or without an answer, do not count.
    """
    import cv2

    if disparity.shape != truth.shape:
        raise InvalidArgument("disparity", f"must have the shape of the truth, {truth.shape}", disparity.shape)
    factor = truth.shape[1] / WIDTH
    reach, apart = math.ceil(BAND * factor) + _neighbours(factor), BETWEEN * factor
    known = np.isfinite(truth)
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    limit = np.finfo(np.float32).max
    foreground = cv2.dilate(np.where(known, truth, -limit).astype(np.float32), square)
    background = cv2.erode(np.where(known, truth, limit).astype(np.float32), square)
    between = (disparity > background + apart) & (disparity < foreground - apart)
    rows, columns = np.nonzero(between & known & near_edges(truth))
    surfaces = np.pad(truth, reach, constant_values=np.nan)
    answers, nearest = disparity[rows, columns], np.full(rows.size, np.inf)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            nearest = np.fmin(nearest, np.abs(surfaces[rows + down, columns + right] - answers))
    flying = np.zeros(truth.shape, np.bool_)
    flying[rows, columns] = nearest > apart
    return flying


def _neighbours(factor: float) -> int:
    return max(1, round(NEIGHBOURS * factor))
