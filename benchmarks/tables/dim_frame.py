"""What of a real frame is valid, also with little light and with a circular field of view."""

from __future__ import annotations

from typing import Any

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table

REGIONS = {
    "mask": "disc of the heart",
    "lit": "heart and ground, lit",
    "dark": "ground, dark",
    "outside": "outside the field of view",
}


def dim_frame_table() -> str:
    """The verdict of each model on each variant of the frame, and the share of valid pixels of each region."""
    record = records.read("accuracy/dim_frame")
    models = record["models"]
    rows = []
    for variant, found in next(iter(models.values())).items():
        of_models = [one[variant] for one in models.values()]
        rows.append([variant, "status", *map(_verdict, of_models)])
        for region, label in REGIONS.items():
            if found[region] is not None:
                rows.append([variant, label, *(percent(one[region]["valid"]) for one in of_models)])
    hashes = record["model_sha256"]
    return table(["frame", "valid", *(records.marked(f"`{name}`", hashes[name]) for name in models)], rows)


def _verdict(found: dict[str, Any]) -> str:
    return ", ".join([found["status"], *found["causes"]])
