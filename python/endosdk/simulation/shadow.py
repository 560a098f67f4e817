"""Light that neighbours take away: a rasteriser casts no shadows, and surfaces that do not shade each other float."""

from __future__ import annotations

import numpy as np

from endosdk.simulation.noise import Array

# Strength, and reach as a share of the picture's width: one for creases and contacts, one for deep places.
REACHES = ((1.1, 0.012), (0.5, 0.06))
DARKEST = 0.25


def near_shadow(disparity: Array) -> Array:
    """Return a factor [H,W], at most 1, that darkens what lies behind its surroundings in the picture."""
    import cv2

    height, width = disparity.shape
    near = np.where(np.isfinite(disparity), disparity, np.float32(0.0)).astype(np.float32)
    small = cv2.resize(near, (max(1, width // 4), max(1, height // 4)), interpolation=cv2.INTER_AREA)
    shade = np.ones_like(near)
    for strength, reach in REACHES:
        around = cv2.resize(cv2.GaussianBlur(small, (0, 0), max(0.5, reach * width / 4)), (width, height))
        behind = np.clip(np.asarray(around, np.float32) / np.maximum(near, 1e-3) - 1.0, 0.0, 2.0)
        shade *= np.exp(-np.float32(strength) * behind)
    return np.asarray(np.maximum(shade, DARKEST), np.float32)
