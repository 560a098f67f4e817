"""Pairs with exact truth and no renderer: a texture seen through a smooth random disparity."""

from __future__ import annotations

import cv2
import numpy as np


def warped_pair(seed, size=(128, 256), disparity=(4.0, 40.0)):
    """Return left, right (uint8 [H, W, 3]) and the disparity [H, W] of the left view, px.

    The left view is the right one read at x - d(x), so the truth holds at every pixel whose match lies inside.
    """
    rng = np.random.default_rng(seed)
    height, width = size
    right = _texture(rng, height, width)
    coarse = rng.uniform(size=(3, 4)).astype(np.float32)
    smooth = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    smooth = (smooth - smooth.min()) / (smooth.max() - smooth.min())
    low, high = np.sort(rng.uniform(*disparity, size=2))
    truth = (low + smooth * (high - low)).astype(np.float32)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    left = cv2.remap(right, x - truth, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return left, right, truth


def _texture(rng, height, width):
    """Sum of noise at several scales, tinted like tissue."""
    grey = np.zeros((height, width), np.float32)
    for cell in (4, 8, 16, 32):
        noise = rng.standard_normal((height // cell + 2, width // cell + 2)).astype(np.float32)
        grey += cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    grey = np.clip(128.0 + 25.0 * grey, 0.0, 255.0)
    return (grey[..., None] * np.array([1.0, 0.7, 0.6], np.float32)).astype(np.uint8)
