"""Between the map of a result and the 16 bits that a recording keeps of each pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.runtime.result import DepthResult, Reason

NONE = 0  # no value
TOO_LARGE = 65535  # a value that does not fit
STEPS = {"depth": 0.1, "disparity": 1 / 64}  # mm, px


def quantity_of(result: DepthResult) -> str:
    """Return what is kept of a result: depth where there is a rig, else disparity."""
    return "disparity" if result.depth_map is None else "depth"


def to_levels(result: DepthResult) -> npt.NDArray[np.uint16]:
    """Return the map as uint16 [H, W], in `STEPS`."""
    name = quantity_of(result)
    values = result.disparity if result.depth_map is None else result.depth_map
    levels = np.clip(np.rint(np.nan_to_num(values, posinf=1e9) / STEPS[name]), 1, TOO_LARGE)
    return np.where(result.reasons == 0, levels, NONE).astype(np.uint16)


def from_levels(levels: npt.NDArray[np.uint16], step: float) -> npt.NDArray[np.float32]:
    """Return the map, mm or px, float32 [H, W]; NaN where there is no value or none that fits."""
    known = (levels != NONE) & (levels != TOO_LARGE)
    return np.where(known, levels * np.float32(step), np.float32(np.nan)).astype(np.float32)


def described(result: DepthResult) -> dict[str, Any]:
    """Return what a line says of the map: its median where there is a value."""
    name = quantity_of(result)
    values = result.disparity if result.depth_map is None else result.depth_map
    known = values[result.reasons == 0]
    unit = "mm" if name == "depth" else "px"
    return {f"median_{name}_{unit}": round(float(np.median(known)), 3) if known.size else None}


def shares_of(reasons: npt.NDArray[np.uint8]) -> dict[str, float]:
    """Return the share of pixels that each reason holds for."""
    counts = np.bincount(reasons.ravel(), minlength=256)
    bits = np.arange(256)
    return {str(reason.name): float(counts[(bits & reason.value) != 0].sum() / reasons.size) for reason in Reason}
