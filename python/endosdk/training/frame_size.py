"""Bring frames to the size at which a network is to see them, by the code that does it once the network is deployed."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from endosdk import _core
from endosdk.calibration.rig import StereoCalibration

Image = NDArray[np.uint8]
ONE_SURFACE = 1.0  # px; truth that differs by less is one surface
NO_TRUTH = -1e6  # stands for NaN where minima and maxima are taken: far from every disparity


def seen_size(width: int, height: int, inference_width: int | None) -> tuple[int, int]:
    """Return (width, height) at which a network for ``inference_width`` sees a frame."""
    seen: tuple[int, int] = _core.network_size_of(width, height, inference_width or 0)
    return seen


def seen_views(left: Image, right: Image, size: tuple[int, int], multiple: int = 1) -> tuple[Image, Image]:
    """Bring both views [H, W, 3] to ``size`` (width, height) and planes: uint8 [3, h, w].

    Sides are padded to multiples of ``multiple`` by repeating the last row and column.
    """
    height, width = left.shape[:2]
    shape = (3, -(-size[1] // multiple) * multiple, -(-size[0] // multiple) * multiple)
    out = np.empty(shape, np.uint8), np.empty(shape, np.uint8)
    left, right = np.ascontiguousarray(left), np.ascontiguousarray(right)
    if size == (width, height):
        _core.pack(left, right, *out, "rgb")
    else:
        _resizer((width, height), size).rectify(left, right, *out, "rgb")
    return out


@lru_cache(maxsize=16)
def _resizer(frame: tuple[int, int], size: tuple[int, int]) -> _core.Rectifier:
    """Return the frame path's rectifier for frames that are rectified already: it only resizes."""
    # Any focal length and baseline do: only the change of size is used.
    rig = StereoCalibration.rectified(focal_px=float(max(frame)), baseline_mm=1.0, size=frame)
    seen = rig.rectification().scaled(*size)
    lens = np.zeros(0)
    left = (rig.model, rig.left_matrix, lens, seen.R1, seen.P1)
    right = (rig.model, rig.right_matrix, lens, seen.R2, seen.P2)
    return _core.Rectifier(*frame, *size, left, right, True)


def seen_truth(disparity: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Bring a disparity map [H, W], px, to ``size`` (width, height), in px of that width; NaN where there is no truth.

    A pixel that covers one surface gets its mean. One across an edge gets the value at its centre: a mean over an edge
    would be a surface that is not there.
    """
    height, width = disparity.shape
    if size == (width, height):
        return disparity
    (tall, top), (wide, left) = _covered(height, size[1]), _covered(width, size[0])
    known = np.nan_to_num(disparity, nan=NO_TRUTH)
    window = np.ones((tall, wide), np.uint8)
    spread = cv2.dilate(known, window, anchor=(0, 0)) - cv2.erode(known, window, anchor=(0, 0))
    middle = cv2.resize(disparity, size, interpolation=cv2.INTER_NEAREST_EXACT)
    apart = spread[np.ix_(top, left)]
    mean = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
    one = (apart < ONE_SURFACE) & np.isfinite(middle)
    shrunk = np.where(one, mean, middle) * np.float32(size[0] / width)
    return np.asarray(shrunk, dtype=np.float32)


def _covered(pixels: int, seen: int) -> tuple[int, NDArray[np.intp]]:
    """Return how many pixels of a side each pixel of the new side covers at most, and the first of each.

    Enlarged, the mean is that of the two pixels around.
    """
    ratio = pixels / seen
    at = np.arange(seen)
    if ratio >= 1.0:
        return math.ceil(ratio) + (pixels % seen > 0), (at * pixels) // seen
    return 2, np.clip(np.floor((at + 0.5) * ratio - 0.5).astype(np.intp), 0, pixels - 1)
