"""The memory that a frame's maps are written to."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from endosdk import _core

IDLE = 1  # maps of one name that wait for the next frame: a loop that keeps its latest result needs no more

FloatMap = npt.NDArray[np.float32]
ByteMap = npt.NDArray[np.uint8]


class Maps(NamedTuple):
    """Output memory of one frame, all [H, W]; depth and sigma are None without a calibration.

    In the order of the core's table of maps. Those after them, of 16 bits, the C library offers.
    """

    disparity: FloatMap
    confidence: FloatMap
    reasons: ByteMap
    depth: FloatMap | None
    sigma: FloatMap | None

    @property
    def writeable(self) -> bool:
        """Whether all maps can be written."""
        return all(each.flags.writeable for each in self if each is not None)


class MapMemory:
    """Gives the maps of each frame memory of their own, and takes it back once nothing looks at it any more.

    Fresh memory costs as much as a tenth of a frame: the system clears every page of it when it is first written.
    """

    def __init__(self, calibrated: bool) -> None:
        """Give depth and sigma only with a calibration."""
        self._kinds = {name: kind for name, kind, metric in _core.output_maps if calibrated or not metric}
        self._idle: dict[str, deque[npt.NDArray[Any]]] = {name: deque(maxlen=IDLE) for name in Maps._fields}

    def maps(self, width: int, height: int) -> Maps:
        """Return maps of this size, px, with what earlier frames or nobody wrote in them."""
        maps: dict[str, Any] = {name: self._map(name, (height, width)) for name in Maps._fields}
        return Maps(**maps)

    def close(self) -> None:
        """Free what waits for the next frame; from now on nothing waits."""
        # Maps that are looked at go back to the old places, which end with the last of them.
        self._idle = {name: deque(maxlen=0) for name in Maps._fields}

    def _map(self, name: str, shape: tuple[int, int]) -> npt.NDArray[Any] | None:
        kind = self._kinds.get(name)
        if kind is None:
            return None
        idle = self._idle[name]
        with suppress(IndexError):  # none waits, or another thread was first
            memory = idle.pop()
            if memory.shape == shape:
                return np.asarray(_Loan(memory, idle))
        return np.asarray(_Loan(np.empty(shape, kind), idle))


class _Loan:
    """Holds the memory of one map for the arrays that look at it, however they were made; then gives it back."""

    def __init__(self, memory: npt.NDArray[Any], idle: deque[npt.NDArray[Any]]) -> None:
        self.__array_interface__ = memory.__array_interface__
        self._memory, self._idle = memory, idle

    def __del__(self) -> None:
        self._idle.append(self._memory)
