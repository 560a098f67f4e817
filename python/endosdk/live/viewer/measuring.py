"""What the page measures: pixels in, values with their standard errors out."""

from __future__ import annotations

from typing import Any

from endosdk.errors import InvalidArgument
from endosdk.live.viewer.player import Shown
from endosdk.measure import Measured, area, path_length, point_at

MOST_PIXELS = 200


def measured(shown: Shown | None, kind: str, pixels: list[list[float]]) -> list[dict[str, Any]]:
    """Measure in the answer that is shown: a ``point``, a ``distance`` along two pixels or more, or an ``area``."""
    if shown is None:
        raise InvalidArgument("measure", "needs an answer on the page", "none yet")
    if not 1 <= len(pixels) <= MOST_PIXELS:
        raise InvalidArgument("pixels", f"must be 1 to {MOST_PIXELS}", len(pixels))
    at = [(float(x), float(y)) for x, y in pixels]
    result = shown.result
    if kind == "point":
        point = point_at(result, *at[0])
        x, y, z = point.xyz
        return [_said("depth", point.depth, f"at x {x:.1f}, y {y:.1f}, z {z:.1f} mm")]
    if kind == "distance":
        return [_said("distance" if len(at) == 2 else "path", path_length(result, at))]
    if kind == "area":
        found = area(result, at)
        inside = f"{100 * found.coverage:.0f} % of the pixels inside have a depth"
        return [_said("area", found.flat, inside), _said("relief", found.relief)]
    raise InvalidArgument("kind", "must be point, distance or area", repr(kind))


def _said(name: str, value: Measured, remark: str = "") -> dict[str, Any]:
    return {
        "name": name,
        "value": value.value,
        "standard_error": value.standard_error,
        "interval": list(value.interval),
        "unit": value.unit,
        "remark": remark,
    }
