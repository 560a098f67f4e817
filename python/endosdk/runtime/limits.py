"""Which answers of a network count: the limits that a host sets."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from endosdk import _core

EVERY_DEPTH = (0.0, math.inf)  # mm


class Limits(NamedTuple):
    """What a pixel needs to be valid, beside what endosdk finds out by itself.

    Attributes:
        min_confidence: the least confidence, 0..1.
        depth_range_mm: (nearest, farthest) depth, mm.
    """

    min_confidence: float = _core.default_min_confidence
    depth_range_mm: tuple[float, float] = EVERY_DEPTH

    def described(self) -> dict[str, Any]:
        """Return what a record says of the limits, as JSON has it; None is a range without an end."""
        ends = [end if math.isfinite(end) else None for end in map(float, self.depth_range_mm)]
        return {"min_confidence": float(self.min_confidence), "depth_range_mm": ends}


DEFAULT_LIMITS = Limits()
