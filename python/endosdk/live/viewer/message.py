"""One answer as one message for the page: facts as JSON, then the left picture, the map and the reasons.

A message is the length of the JSON in 4 bytes, little-endian, the JSON, and the parts whose lengths it states: a JPEG
of the rectified left view, the map as uint16 (0 where there is no value) and the reasons as uint8, both thinned out.
"""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import numpy as np

from endosdk import _core
from endosdk.live.frames import Picture
from endosdk.live.recording.sixteen_bits import STEPS, quantity_of, to_levels
from endosdk.live.viewer.player import Shown
from endosdk.runtime.overview import robust_range
from endosdk.runtime.result import Cause, DepthResult

WIDEST_MAP = 480  # px that the page is sent of a map
WIDEST_PICTURE = 960
JPEG_QUALITY = 85


def encoded(shown: Shown, left: Picture, state: dict[str, Any]) -> bytes:
    """Return the message for one answer; ``state`` is added to its facts."""
    import cv2

    result = shown.result
    name, unit, values = quantity_of(result)
    thin = -(-values.shape[1] // WIDEST_MAP)
    values, reasons = values[::thin, ::thin], np.ascontiguousarray(result.reasons[::thin, ::thin])
    step = STEPS[name]
    levels = to_levels(values, reasons, step).astype("<u2")
    smaller = -(-left.shape[1] // WIDEST_PICTURE)
    picture = cv2.cvtColor(np.ascontiguousarray(left[::smaller, ::smaller]), cv2.COLOR_RGB2BGR)
    _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    low, high = robust_range(np.where(reasons == 0, values, np.nan))
    facts = {
        **described(shown),
        "map": {"name": name, "unit": unit, "step": step, "low": low, "high": high},
        "size": [int(result.disparity.shape[1]), int(result.disparity.shape[0])],
        "thin": thin,
        "columns": int(levels.shape[1]),
        "rows": int(levels.shape[0]),
        "parts": [len(jpeg), levels.nbytes, reasons.nbytes],
        "camera": _camera(result),
        **state,
    }
    head = json.dumps(facts, allow_nan=False).encode()
    return struct.pack("<I", len(head)) + head + jpeg.tobytes() + levels.tobytes() + reasons.tobytes()


def described(shown: Shown) -> dict[str, Any]:
    """Return what one line says of an answer."""
    result, times = shown.result, shown.result.timings
    return {
        "number": shown.frame.number,
        "stamp_ns": shown.frame.stamp_ns,
        "turn": shown.turn,
        "fault": shown.frame.fault,
        "status": result.status.name,
        "causes": [_cause(cause, measure) for cause, measure in result.causes.items()],
        "valid_share": result.valid_share,
        "reasons": result.reason_shares,
        "milliseconds": {"rectify": times.rectify_ms, "session": times.session_ms, "postprocess": times.postprocess_ms},
        "delay_ms": shown.delay_ms,
        "frames_per_second": shown.frames_per_second,
        **_health(result),
    }


def _health(result: DepthResult) -> dict[str, float | None]:
    """Return what the pictures tell of the rig: rows that do not match, and the turn of the right camera, degrees."""
    rig = result.rig
    turn = None if rig is None else rig.steady_rotation_deg
    return {
        "rows_off_px": None if rig is None else rig.vertical_disparity_px,
        "turn_deg": None if turn is None else math.hypot(*turn),
    }


def _cause(cause: Cause, measure: float) -> dict[str, Any]:
    """Return what the page says of one cause: its name, what was measured, and what to do."""
    fact = _core.cause_facts[cause]
    return {
        "name": cause.name,
        "value": measure,
        "measure": fact["measure"],
        "meaning": fact["meaning"],
        "remedy": fact["remedy"],
    }


def _camera(result: DepthResult) -> dict[str, float] | None:
    g = result.geometry
    return None if g is None else {"fx": g.focal_px, "fy": g.focal_y_px, "cx": g.cx, "cy": g.cy}
