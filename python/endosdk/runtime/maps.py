"""The memory that a frame's maps are written to."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from endosdk import _core

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

    @classmethod
    def allocate(cls, width: int, height: int, calibrated: bool) -> Maps:
        """Reserve memory for maps of this size, px."""

        def memory(kind: np.dtype[Any], metric: bool) -> npt.NDArray[Any] | None:
            return np.empty((height, width), kind) if calibrated or not metric else None

        wanted = [facts for facts in _core.output_maps if facts[0] in cls._fields]
        maps: dict[str, Any] = {name: memory(kind, metric) for name, kind, metric in wanted}
        return cls(**maps)

    @property
    def writeable(self) -> bool:
        """Whether all maps can be written."""
        return all(each.flags.writeable for each in self if each is not None)
