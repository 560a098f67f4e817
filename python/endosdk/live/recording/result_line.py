"""What one line of a recording, or a message of ROS, says of a result."""

from __future__ import annotations

from typing import Any

import numpy as np

from endosdk.live.recording.sixteen_bits import quantity_of
from endosdk.runtime.result import DepthResult


def said_of(result: DepthResult) -> dict[str, Any]:
    """Return the verdict on a frame, the median of its map where there is a value, and times, as JSON values."""
    name, unit, values = quantity_of(result)
    known = values[result.reasons == 0]
    times = result.timings
    return {
        "status": result.status.name,
        "causes": {cause.name: round(measure, 5) for cause, measure in result.causes.items()},
        "valid_share": round(result.valid_share, 5),
        "reasons": {reason: round(share, 5) for reason, share in result.reason_shares.items()},
        f"median_{name}_{unit}": round(float(np.median(known)), 3) if known.size else None,
        "milliseconds": {
            "rectify": round(times.rectify_ms, 3),
            "session": round(times.session_ms, 3),
            "postprocess": round(times.postprocess_ms, 3),
        },
    }
