"""How far the errors of neighbouring pixels go together."""

from __future__ import annotations

from endosdk.runtime.result import DepthResult

# Of the map's width: fitted on rendered training scenes, where the error of each pixel is known.
CORRELATION_SHARE = 0.027


def correlation_length(result: DepthResult) -> float:
    """Return the distance, px of the map, over which the correlation of depth errors falls to 1/e."""
    return CORRELATION_SHARE * float(result.disparity.shape[1])
