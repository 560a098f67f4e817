"""Whether the two views of a rendered pair agree with its truth: one moved by the truth is the other."""

from __future__ import annotations

import cv2
import numpy as np

from endosdk.datasets.dataset import Sample


def at_match(picture: np.ndarray, disparity: np.ndarray, shift: float = 0.0) -> np.ndarray:
    """The right picture where the left pixels' matches lie, moved by ``shift`` px."""
    rows, columns = np.indices(disparity.shape, np.float32)
    place = columns - np.nan_to_num(disparity) + np.float32(shift)
    return np.asarray(cv2.remap(picture, place, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def detail(view: np.ndarray) -> np.ndarray:
    """A view without its exposure and without highlights, which move with the eye."""
    view = view.astype(np.float32)
    return np.asarray(np.clip(view - cv2.blur(view, (7, 7)), -20, 20).mean(2))


def seen_by_both(sample: Sample) -> np.ndarray:
    """The pixels [H,W] of the left view whose neighbourhood the right view sees as well."""
    assert sample.occlusion is not None
    return np.asarray(cv2.erode((~sample.occlusion).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)


def check_views_match_best_at_the_truth(sample: Sample, gain: float = 1.0) -> None:
    """The right view moved by the truth is the left view; moved by half a pixel more or less it is not.

    The error at the truth must be less than ``gain`` of that on either side.
    """
    left, seen = detail(sample.left), seen_by_both(sample)
    error = {
        shift: float(np.abs(detail(at_match(sample.right, sample.disparity, shift)) - left)[seen].mean())
        for shift in (-0.5, 0.0, 0.5)
    }
    assert error[0.0] < gain * min(error[-0.5], error[0.5])
