"""The rules for the arguments of a `DepthEstimator`; what breaks one is an `InvalidArgument` that names it."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from endosdk import _core
from endosdk.errors import CalibrationRequired, InvalidArgument
from endosdk.runtime.rectify import CHANNEL_ORDERS

MOST_THREADS = 256
LONGEST_SIDE = 32767  # px, of the pictures that a network is shown: the core stores positions in 16 bits


def check_order(order: Any) -> str:
    """Return the order of colour channels."""
    if not isinstance(order, str) or order not in CHANNEL_ORDERS:
        raise InvalidArgument("channel_order", f"must be one of {', '.join(CHANNEL_ORDERS)}", repr(order))
    return order


def check_share(name: str, value: Any) -> float:
    """Return a number in 0..1."""
    if not _is_number(value) or not 0.0 <= value <= 1.0:
        raise InvalidArgument(name, "must be a number in 0..1", repr(value))
    return float(value)


def check_range(depth_range_mm: Any, calibrated: bool) -> tuple[float, float]:
    """Return (nearest, farthest), mm; anything but the whole range needs a calibration."""
    pair = _pair("depth_range_mm", depth_range_mm, "must be (nearest, farthest) with 0 <= nearest < farthest")
    low, high = pair
    if not 0.0 <= low < high:
        raise InvalidArgument("depth_range_mm", "must be (nearest, farthest) with 0 <= nearest < farthest", pair)
    if not calibrated and pair != (0.0, math.inf):
        raise CalibrationRequired("depth_range_mm", "needs a calibration: pass calibration=rig", "no calibration")
    return float(low), float(high)


def check_size(size: Any) -> tuple[int, int]:
    """Return (width, height), px."""
    rule = f"must be (width, height) in whole pixels, 1 to {LONGEST_SIDE}"
    pair = _pair("network_size", size, rule)
    if not all(1 <= side <= LONGEST_SIDE and int(side) == side for side in pair):
        raise InvalidArgument("network_size", rule, pair)
    return int(pair[0]), int(pair[1])


def check_threads(threads: Any) -> int:
    """Return the number of threads; None stands for the cores of this process."""
    if threads is None:
        return _core.default_threads()
    if not _is_number(threads) or not 1 <= threads <= MOST_THREADS or int(threads) != threads:
        raise InvalidArgument("threads", f"must be a whole number, 1 to {MOST_THREADS}", repr(threads))
    return int(threads)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _pair(name: str, values: Any, rule: str) -> tuple[Any, Any]:
    if not isinstance(values, tuple | list) or len(values) != 2 or not all(map(_is_number, values)):
        raise InvalidArgument(name, rule, repr(values))
    return values[0], values[1]
