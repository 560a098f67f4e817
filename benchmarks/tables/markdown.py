"""How a table is written."""

from __future__ import annotations

from benchmarks.tables.records import STALE, STALE_NOTE


def table(heads: list[str], rows: list[list[str]]) -> str:
    """Return a table of Markdown, with the note on marked rows where one is marked."""
    lines = [heads, ["---"] * len(heads), *rows]
    text = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    labels = [*heads, *(cells[0] for cells in rows)]
    return text + (f"\n{STALE_NOTE}\n" if any(STALE in label for label in labels) else "")


def percent(share: float) -> str:
    """Write a share."""
    return f"{100 * share:.1f} %"
