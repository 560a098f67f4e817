"""What a row of a table holds of the measures of `endosdk.evaluation`."""

from __future__ import annotations

from typing import Any

KPE = (1, 2, 3, 5)
# Parts of the pixels whose error stands in a row beside that of all.
PARTS = ("occluded", "edges", "glare", "low_texture", "instrument_edges", "in_range")


def row(scores: dict[str, Any]) -> dict[str, Any]:
    """Reduce the measures of `evaluate` to a row of the table; shares are 0..1, times in ms."""
    whole, visible = scores["all"], scores.get("non_occluded")
    parts = {name: scores[name] for name in PARTS if scores.get(name, {}).get("valid")}
    within = parts.pop("in_range", None)
    return {
        "epe": whole["epe_px"],
        "kpe": {str(k): whole[f"kpe_{k}"] for k in KPE},
        "epe_noc": visible["epe_px"] if visible else None,
        "kpe_noc": {str(k): visible[f"kpe_{k}"] for k in KPE} if visible else None,
        "coverage": whole["coverage"],
        "depth_mae_mm": whole.get("depth_mae_mm"),
        "pixels": whole["pixels"],
        "pixels_noc": visible["pixels"] if visible else None,
        "pairs": scores["pairs"],
        "ms": scores["ms_median"],
        "epe_in_range": within["epe_px"] if within else None,
        "pixels_in_range": within["pixels"] if within else None,
        "noise": whole.get("noise_px"),
        "parts": {name: {"epe": found["epe_px"], "pixels": found["pixels"]} for name, found in parts.items()},
    }
