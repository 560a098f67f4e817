"""The memory that a frame's maps are written to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatMap = npt.NDArray[np.float32]
ByteMap = npt.NDArray[np.uint8]


class Maps(NamedTuple):
    """Output memory of one frame, all [H, W]; depth and sigma are None without a calibration."""

    disparity: FloatMap
    confidence: FloatMap
    reasons: ByteMap
    depth: FloatMap | None
    sigma: FloatMap | None

    @classmethod
    def allocate(cls, width: int, height: int, metric: bool) -> Maps:
        """Reserve memory for maps of this size, px."""

        def floats() -> FloatMap:
            return np.empty((height, width), np.float32)

        reasons = np.empty((height, width), np.uint8)
        return cls(floats(), floats(), reasons, floats() if metric else None, floats() if metric else None)

    @property
    def writeable(self) -> bool:
        """Whether all maps can be written."""
        return all(each.flags.writeable for each in self if each is not None)
