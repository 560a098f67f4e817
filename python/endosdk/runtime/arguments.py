"""The types of what a `DepthEstimator` is given; the compiled core checks the values."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.errors import InvalidArgument

Picture = npt.NDArray[np.uint8]

CHANNEL_ORDERS = ("rgb", "bgr")
QUEUES = ("every", "newest")


def check_order(order: Any) -> str:
    """Return the order of colour channels."""
    if not isinstance(order, str) or order not in CHANNEL_ORDERS:
        raise InvalidArgument("channel_order", f"must be one of {', '.join(CHANNEL_ORDERS)}", repr(order))
    return order


def check_queue(queue: Any) -> None:
    """Refuse what is no word for the pairs of a source that are computed."""
    if not isinstance(queue, str) or queue not in QUEUES:
        raise InvalidArgument("queue", f"must be one of {', '.join(QUEUES)}", _shown(queue))


def check_number(name: str, value: Any, rule: str) -> float:
    """Return a number."""
    if not _is_number(value):
        raise InvalidArgument(name, rule, _shown(value))
    return _float(name, value, rule)


def check_numbers(name: str, values: Any, rule: str) -> npt.NDArray[np.float64]:
    """Return numbers as an array, of whatever shape."""
    try:
        array = np.asarray(values)
    except ValueError as error:  # lists of several lengths
        raise InvalidArgument(name, rule, _shown(values)) from error
    if array.dtype.kind not in "iuf":
        raise InvalidArgument(name, rule, _shown(values))
    return array.astype(np.float64, copy=False)


def check_switch(name: str, value: Any) -> bool:
    """Return whether something is on; a word such as "no" would count as yes."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidArgument(name, "must be True or False", _shown(value))
    return bool(value)


def check_stamp(stamp_ns: Any) -> int:
    """Return when a pair was taken, 0 where nobody said."""
    if stamp_ns is None:
        return 0
    if isinstance(stamp_ns, bool) or not isinstance(stamp_ns, int | np.integer) or not 0 < stamp_ns < 2**63:
        raise InvalidArgument("stamp_ns", "must be a whole number of nanoseconds, above 0", _shown(stamp_ns))
    return int(stamp_ns)


def check_range(depth_range_mm: Any) -> tuple[float, float]:
    """Return (nearest, farthest), mm."""
    rule = "must be (nearest, farthest) with 0 <= nearest < farthest"
    low, high = _pair("depth_range_mm", depth_range_mm, rule)
    return _float("depth_range_mm", low, rule), _float("depth_range_mm", high, rule)


def check_size(size: Any) -> tuple[int, int] | None:
    """Return (width, height), px; None stays None."""
    if size is None:
        return None
    rule = "must be (width, height) in whole pixels"
    pair = _pair("network_size", size, rule)
    return _whole("network_size", pair[0], rule, pair), _whole("network_size", pair[1], rule, pair)


def check_frame_size(width: Any, height: Any) -> tuple[int, int]:
    """Return the size of a frame, px."""
    rule = "must be two whole numbers, width and height"
    if not (_is_number(width) and _is_number(height)):
        raise InvalidArgument("size", rule, _shown((width, height)))
    return _whole("size", width, rule, (width, height)), _whole("size", height, rule, (width, height))


def check_threads(threads: Any) -> int:
    """Return the number of threads; 0 stands for the cores of this process, and None for that."""
    if threads is None:
        return 0
    rule = f"must be a whole number, 1 to {_core.max_threads}"
    if not _is_number(threads) or threads == 0:
        raise InvalidArgument("threads", rule, _shown(threads))
    return _whole("threads", threads, rule, threads)


def check_pair(left: object, right: object) -> tuple[Picture, Picture]:
    """Return both frames as arrays the core accepts; refuse what is no uint8 picture."""
    return _check_frame("left", left), _check_frame("right", right)


def _check_frame(name: str, frame: object) -> Picture:
    if not isinstance(frame, np.ndarray):
        raise InvalidArgument(name, "must be a NumPy array", type(frame).__name__)
    if frame.dtype != np.uint8:
        raise InvalidArgument(name, "must be uint8, 0..255", frame.dtype)
    if frame.ndim not in (2, 3) or (frame.ndim == 3 and frame.shape[2] not in (1, 3)):
        raise InvalidArgument(name, "must be [H, W], [H, W, 1] or [H, W, 3]", frame.shape)
    # Kernels take any row pitch but need the pixels of a row side by side.
    pixel_bytes = 1 if frame.ndim == 2 else frame.shape[2]
    packed = frame.strides[1] == pixel_bytes and (frame.ndim == 2 or frame.strides[2] == 1)
    return frame if packed and abs(frame.strides[0]) >= pixel_bytes * frame.shape[1] else np.ascontiguousarray(frame)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _whole(name: str, value: Any, rule: str, shown: Any) -> int:
    # The core counts in 32 bits; what does not fit is beyond every limit there.
    if not abs(value) < 2**31 or int(value) != value:
        raise InvalidArgument(name, rule, _shown(shown))
    return int(value)


def _float(name: str, value: Any, rule: str) -> float:
    try:
        return float(value)
    except OverflowError as error:
        raise InvalidArgument(name, rule, _shown(value)) from error


def _shown(value: Any) -> str:
    """Return a value as code writes it. Python writes no whole number of more than some thousand digits."""
    try:
        return repr(value)
    except ValueError:
        return "a number of too many digits"


def _pair(name: str, values: Any, rule: str) -> tuple[Any, Any]:
    if not isinstance(values, tuple | list) or len(values) != 2 or not all(map(_is_number, values)):
        raise InvalidArgument(name, rule, _shown(values))
    return values[0], values[1]
