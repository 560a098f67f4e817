"""What the temporal filter gains on video, and how exact measurements are."""

from __future__ import annotations

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table


def temporal_table() -> str:
    """What the filter in time leaves of flicker, jumps and errors, as a share of what there is without it."""
    record = records.read("accuracy/temporal")
    means = {kind: record[kind]["mean"] for kind in ("still", "flight", "tool")}
    still, flight, tool = means.values()
    rows = [
        ["the scene stands still", still["flicker_ratio"], still["jump_ratio"], still["error_ratio"]],
        ["flight", None, flight["jump_ratio"], flight["error_ratio"]],
        ["flight, every fourth frame", None, None, flight["error_ratio_quick"]],
        ["flight with a moving tool", None, tool["jump_ratio"], tool["error_ratio"]],
        ["beside the tool", None, tool["jump_ratio_beside_the_tool"], None],
        ["on the tool", None, tool["jump_ratio_on_the_tool"], None],
        ["within 12 px of the tool", None, None, tool["error_ratio_near_tool"]],
    ]
    cells = [[label, *("" if one is None else f"{one:.2f}" for one in ratios)] for label, *ratios in rows]
    return table([records.marked("video", record["model_sha256"]), "flicker", "jumps", "error"], cells)


def measuring_table() -> str:
    """How often the intervals of measures hold the truth, and how far the measures are off."""
    labels = {"depth": "depth of a point", "distance": "distance from edge to edge", "area": "area", "relief": "relief"}
    record = records.read("accuracy/measuring")
    columns = {**{name: found["all"] for name, found in record["sets"].items()}, "together": record["all"]}
    rows = [
        [
            label,
            str(record["all"][kind]["measurements"]),
            *(percent(found[kind]["within_95"]) for found in columns.values()),
            percent(record["all"][kind]["median_relative_error"]),
        ]
        for kind, label in labels.items()
    ]
    heads = [records.marked("measured", record["model_sha256"]), "times"]
    return table([*heads, *(f"within, {name}" for name in columns), "median error"], rows)
