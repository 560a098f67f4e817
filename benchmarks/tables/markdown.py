"""How a table is written."""

from __future__ import annotations

from benchmarks.tables.records import NOTES


def table(heads: list[str], rows: list[list[str]]) -> str:
    """Return a table of Markdown, with the notes on the marks that its labels have."""
    lines = [heads, ["---"] * len(heads), *rows]
    text = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    labels = [*heads, *(cells[0] for cells in rows)]
    return text + "".join(f"\n{note}\n" for mark, note in NOTES.items() if any(mark in label for label in labels))


def percent(share: float) -> str:
    """Write a share."""
    return f"{100 * share:.1f} %"
