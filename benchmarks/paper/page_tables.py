"""What stands between the marks of the page on the paper: tables from the records, and the curves that are drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from benchmarks.paper import score_tables, verdict_tables
from benchmarks.paper.experiments import GROUPS
from benchmarks.paper.paper_records import PaperRecords

FROM_RECORDS: dict[str, Callable[[PaperRecords], str]] = {
    "not-run": score_tables.not_run_table,
    "sets": score_tables.sets_table,
    "errors": score_tables.errors_table,
    "runs": score_tables.runs_table,
    "search": score_tables.search_table,
    "learned": score_tables.learned_table,
    "stages": score_tables.stages_table,
    "parts": score_tables.parts_table,
    "ablations": score_tables.ablations_table,
    "earlier": score_tables.earlier_table,
    "repeats": verdict_tables.repeats_table,
    "methods": verdict_tables.methods_table,
    "pictures": verdict_tables.pictures_table,
    "claims": verdict_tables.claims_table,
    "target": verdict_tables.target_table,
}
CURVES = {"loss": "loss", "epe": "test error", "epe_in_range": "test error within the range"}


def page_tables(results: Path, docs: Path) -> dict[str, Callable[[], str]]:
    """Return every table of the page by its name: from the records in ``results``, with the figures in ``docs``."""

    def of(make: Callable[[PaperRecords], str]) -> Callable[[], str]:
        return lambda: make(PaperRecords(results))

    tables = {f"paper-{name}": of(make) for name, make in FROM_RECORDS.items()}
    return {**tables, "paper-protocols": score_tables.protocols_table, "paper-curves": lambda: curves(docs)}


def curves(docs: Path) -> str:
    """Show the curves of the ablations, as far as they have been drawn."""
    shown = [
        f"![{group.title}: {said}]({file.name})\n"
        for key, group in GROUPS.items()
        for curve, said in CURVES.items()
        if (file := docs / f"{key}_{curve}.png").exists()
    ]
    return "\n".join(shown)
