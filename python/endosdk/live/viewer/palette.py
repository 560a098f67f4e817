"""The colours of the page, from the one place where this project's pictures have theirs."""

from __future__ import annotations

from typing import Any

import numpy as np

from endosdk.runtime.overview import REASON_STYLE, colour_map


def legend() -> dict[str, Any]:
    """Return 256 colours for values from low to high, and colour and name of every reason, by its bit."""
    ramp = colour_map(np.linspace(0, 1, 256, dtype=np.float32)[None], 0.0, 1.0)[0]
    reasons = [
        {"bit": int(reason.value), "name": str(reason.name), "label": label, "colour": list(colour)}
        for reason, (colour, label) in REASON_STYLE.items()
    ]
    return {"ramp": ramp.tolist(), "reasons": reasons}
