"""What the temporal filter gains on video, and how exact measurements are."""

from __future__ import annotations

from typing import Any

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table


def temporal_table() -> str:
    """What the filter in time leaves of flicker, jumps and errors, as a share of what there is without it."""
    record = records.read("accuracy/temporal")
    still, flight, tool = (record[kind] for kind in ("still", "flight", "tool"))
    rows: list[tuple[str, dict[str, Any], tuple[str | None, ...]]] = [
        ("the scene stands still", still, ("flicker_ratio", "jump_ratio", "error_ratio")),
        ("flight", flight, (None, "jump_ratio", "error_ratio")),
        ("flight, every fourth frame", flight, (None, None, "error_ratio_quick")),
        ("flight with a moving tool", tool, (None, "jump_ratio", "error_ratio")),
        ("beside the tool", tool, (None, "jump_ratio_beside_the_tool", None)),
        ("on the tool", tool, (None, "jump_ratio_on_the_tool", None)),
        ("within 12 px of the tool", tool, (None, None, "error_ratio_near_tool")),
    ]
    cells = [
        [label, *("" if key is None else _mean_and_worst(films, key) for key in keys)] for label, films, keys in rows
    ]
    return table([records.marked("video", record["model_sha256"]), "flicker", "jumps", "error"], cells)


def _mean_and_worst(films: dict[str, dict[str, float]], key: str) -> str:
    worst = max(found[key] for name, found in films.items() if name != "mean")
    return f"{films['mean'][key]:.2f}, worst {worst:.2f}"


def measuring_table() -> str:
    """How often the intervals of measures hold the truth, and how far the measures are off, in each set."""
    labels = {"depth": "depth of a point", "distance": "distance from edge to edge", "area": "area", "relief": "relief"}
    record = records.read("accuracy/measuring")
    rows = []
    for kind, label in labels.items():
        for name, found in record["sets"].items():
            one = found["all"][kind]
            times = [str(sum(found["objects"].values())), str(one["measurements"])]
            errors = [f"{one['rms_in_standard_errors']:.2f}", percent(one["median_relative_error"])]
            rows.append([label, name, *times, percent(one["within_95"]), *errors])
    heads = [records.marked("measured", record["model_sha256"]), "set", "objects in the set", "times"]
    return table([*heads, "within the interval", "rms error, standard errors", "median error"], rows)
