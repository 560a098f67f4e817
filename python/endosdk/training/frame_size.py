"""Bring frames to the width at which a network is to see them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def reduction(width: int, inference_width: int | None) -> int:
    """Return the whole factor by which frames of this width are reduced for a network; 1: not at all."""
    return 1 if inference_width is None else max(1, round(width / inference_width))


def reduced_view(view: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Average blocks of ``factor`` x ``factor`` pixels of [H, W, 3]; what fills no block at the border is left out."""
    if factor == 1:
        return view
    height, width = (side // factor for side in view.shape[:2])
    whole = np.ascontiguousarray(view[: height * factor, : width * factor])
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def reduced_truth(disparity: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Do the same for a disparity map [H, W], px, whose values shrink with it; NaN where there is no truth.

    A block on one surface gives its mean. A block across an edge gives its middle pixel's value: a mean over an edge
    would be a surface that is not there.
    """
    if factor == 1:
        return disparity
    height, width = (side // factor for side in disparity.shape)
    blocks = disparity[: height * factor, : width * factor].reshape(height, factor, width, factor)
    mean = blocks.mean(axis=(1, 3))
    one_surface = blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3)) < 1.0
    middle = blocks[:, factor // 2, :, factor // 2]
    return (np.where(one_surface, mean, middle) / factor).astype(np.float32)
