"""Between the map of a result and the 16 bits that a recording keeps of each pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from endosdk.runtime.result import DepthResult

NONE = 0  # no value
TOO_LARGE = 65535  # a value that does not fit
STEPS = {"depth": 0.1, "disparity": 1 / 64}  # mm, px


def quantity_of(result: DepthResult) -> tuple[str, str, npt.NDArray[np.float32]]:
    """Return name, unit and map of what is kept of a result: depth where there is a rig, else disparity."""
    return ("disparity", "px", result.disparity) if result.depth_map is None else ("depth", "mm", result.depth_map)


def to_levels(values: npt.NDArray[np.float32], reasons: npt.NDArray[np.uint8], step: float) -> npt.NDArray[np.uint16]:
    """Return a map as uint16 [H, W], in steps of ``step``; 0 where there is a reason against a value."""
    levels = np.clip(np.rint(np.nan_to_num(values, posinf=1e9) / step), 1, TOO_LARGE)
    return np.where(reasons == 0, levels, NONE).astype(np.uint16)


def from_levels(levels: npt.NDArray[np.uint16], step: float) -> npt.NDArray[np.float32]:
    """Return the map, mm or px, float32 [H, W]; NaN where there is no value or none that fits."""
    known = (levels != NONE) & (levels != TOO_LARGE)
    return np.where(known, levels * np.float32(step), np.float32(np.nan)).astype(np.float32)
