"""The area inside a polygon and how far the surface stands out of its plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from endosdk import _core
from endosdk.measure.lengths import Measured, Pixel, checked_pixels, measured_maps
from endosdk.runtime.result import DepthResult


@dataclass(frozen=True)
class Area:
    """What a polygon encloses.

    ``flat`` is the area of its outline on the plane that fits the surface inside best, mm²: what a ruler on a print of
    it would give. ``relief`` is how far the surface reaches from its lowest to its highest place across that plane, mm,
    without the outermost 5 % of the pixels. ``coverage`` is the share of the pixels inside that have a depth.
    """

    flat: Measured
    relief: Measured
    coverage: float


def area(result: DepthResult, polygon: Sequence[Pixel]) -> Area:
    """Measure the surface inside a polygon of 3 to 10,000 pixels; a pixel is inside when its centre is.

    Raises InvalidArgument where the polygon leaves the map, crosses itself, holds depth on fewer than 30 or half of
    its pixels, or reaches past the horizon of the plane through them; CalibrationRequired without a rig.
    """
    flat, flat_error, relief, relief_error, coverage = _core.area(
        *measured_maps(result), checked_pixels("polygon", polygon)
    )
    return Area(Measured(flat, flat_error, "mm²"), Measured(relief, relief_error), coverage)
