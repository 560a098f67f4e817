"""The records of the paper's experiments as the page shows them: which there are, and the labels of their rows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.paper.experiments import LABELS, PAPER_PROTOCOL, SEEDS, crops, rows_by_name, size
from benchmarks.paper.one_kind import check_one_kind
from benchmarks.paper.verdicts import Bound, Rows, repeat_bound
from benchmarks.tables.records import marked

NOT_RECORDED = "not recorded"
SAME_ERROR = 1e-3  # share by which a method's errors on two renderings of the same pictures may differ


@dataclass(frozen=True)
class PaperRecords:
    """What lies in a folder of results. A record that is missing is empty. Read anew for every page."""

    results: Path

    @cached_property
    def table(self) -> dict[str, Any]:
        """The methods on the test pairs. Raises InvalidArgument when its runs are of different kinds."""
        found = self.read("paper/table1")
        check_one_kind("table1.json", found.get("methods", {}))
        return found

    @cached_property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Every table of methods, by the name of its pairs; the first is Table 1."""
        others = [file.stem for file in sorted(self.results.glob("paper/table1_*.json"))]
        found = [self.table, *(self._of_one_kind(name) for name in others)]
        return {self._pairs_of(table): table for table in found if table}

    def _of_one_kind(self, name: str) -> dict[str, Any]:
        table = self.read(f"paper/{name}")
        check_one_kind(f"{name}.json", table["methods"])
        return table

    def _pairs_of(self, table: dict[str, Any]) -> str:
        """Name the pairs of a table, as they differ from those of Table 1."""
        if table is self.table or table["dataset"] != self.table.get("dataset"):
            return str(table["dataset"])
        if table["sha256"] != self.table["sha256"]:
            return f"{table['dataset']}, rendered anew ({table['sha256'][:8]})"
        return f"{table['dataset']}, first {table['pairs']}"

    @cached_property
    def same_pictures(self) -> dict[str, dict[str, Any]]:
        """Table 1 and the tables on other renderings of its pictures, by the name of their pairs.

        Another processor writes other files for the same scenes. So the errors tell: methods whose results are the
        same everywhere, matchers and shipped models, must have those of Table 1.
        """
        return {pairs: found for pairs, found in self.tables.items() if found is self.table or self._alike(found)}

    def _alike(self, other: dict[str, Any]) -> bool:
        if any(other.get(key) != self.table.get(key) for key in ("dataset", "pairs")):
            return False
        known, found = self.table["methods"], other["methods"]
        both = [
            (known[name], found[name]) for name in known.keys() & found.keys() if "checkpoint_sha256" not in known[name]
        ]
        same = [(a, b) for a, b in both if a.get("model_sha256") == b.get("model_sha256")]
        return bool(same) and all(abs(a["epe"] - b["epe"]) <= SAME_ERROR * a["epe"] for a, b in same)

    @cached_property
    def compared(self) -> Rows:
        """Every method on the pictures of Table 1, by its name; the row of Table 1 where there are several."""
        rows: Rows = {}
        for found in self.same_pictures.values():
            rows = {**found["methods"], **rows}
        return rows

    def beside_each_other(self, *names: str) -> tuple[str, Rows] | None:
        """Return where these methods can be compared: the pairs, and the rows on them; None where they cannot.

        That is on the pictures of Table 1 or, where one was never scored on all of these, on fewer.
        """
        if all(name in self.compared for name in names):
            seen = (
                next(pairs for pairs, found in self.same_pictures.items() if name in found["methods"]) for name in names
            )
            return " and ".join(dict.fromkeys(seen)), self.compared
        for pairs, found in self.tables.items():
            if found["sha256"] == self.table.get("sha256") and all(name in found["methods"] for name in names):
                return pairs, found["methods"]
        return None

    @cached_property
    def ablations(self) -> list[dict[str, Any]]:
        """The records of ablations on the pictures of Table 1, each of one kind; InvalidArgument if one is not."""
        names = [file.stem for file in sorted(self.results.glob("paper/ablations*.json"))]
        found = {name: self.read(f"paper/{name}") for name in names}
        for name, record in found.items():
            check_one_kind(f"{name}.json", rows_by_name(record["groups"]))
        pictures = {table["sha256"] for table in self.same_pictures.values()}
        return [record for name, record in found.items() if name == "ablations" or record["sha256"] in pictures]

    @cached_property
    def ablated(self) -> Rows:
        """Every row of the ablations, by the name of its run."""
        rows: Rows = {}
        for record in reversed(self.ablations):
            rows |= rows_by_name(record["groups"])
        return {name: {**row, "last_loss": loss_of_last_epoch(row)} for name, row in rows.items()}

    @cached_property
    def known(self) -> Rows:
        """Every row of Table 1 and of the ablations, by the name of its run."""
        methods = self.table.get("methods", {})
        return {
            **{name: {**row, "last_loss": loss_of_last_epoch(row)} for name, row in methods.items()},
            **self.ablated,
        }

    @cached_property
    def methods(self) -> dict[str, dict[str, Any]]:
        """A row of every method in any of the tables, by its name; that of Table 1 where there are several."""
        rows: dict[str, dict[str, Any]] = {}
        for found in self.tables.values():
            rows = {**found["methods"], **rows}
        return rows

    def bound(self, measure: str = "epe") -> Bound:
        """By how much a measure of two runs of one setting differs, of runs with as many pairs as those of Table 1."""
        return repeat_bound(self.known, measure, PAPER_PROTOCOL["train_pairs"])

    def read(self, name: str) -> dict[str, Any]:
        """Return a record by its folder and name."""
        file = self.results / f"{name}.json"
        return dict(json.loads(file.read_text())) if file.exists() else {}


def loss_of_last_epoch(row: dict[str, Any]) -> float | None:
    """Return the mean training loss of the last epoch.

    None for an older row: its run logged one batch of twenty, which says little of an epoch.
    """
    return row["last_loss"] if (row.get("curve") or {}).get("loss_steps") else None


def label_of(name: str, row: dict[str, Any]) -> str:
    """Return the label of a method's row. That of a shipped model has its version, and a mark if the file is gone."""
    label = {**LABELS, **SEEDS}[name]
    if "version" not in row:
        return label
    # A row without a hash is from before records had them.
    return marked(f"{label}, version {row['version']}", row.get("model_sha256") or "none")


def given(row: dict[str, Any]) -> list[str]:
    """Say what a row was given: samples, training pairs, products, hours, precision, seed and budget."""
    if "samples_seen" in row:
        hours = f"{row['hours']:.2f}" if row.get("hours") is not None else NOT_RECORDED
        more = [hours, row.get("precision") or NOT_RECORDED, str(row.get("seed", 0))]  # every older run had seed 0
        budget = str(row.get("budget", "")).upper() or NOT_RECORDED
        return [_samples(row), _pairs(row.get("train_data")), f"{row['training_tmacs']:.0f}", *more, budget]
    if row.get("trained_on"):
        return ["a recipe of our own", _pairs(row["trained_on"]), *([""] * 5)]
    return ["no training", *([""] * 6)]


def _samples(row: dict[str, Any]) -> str:
    seen = crops(row["samples_seen"], row["crop"])
    if not row["complete"]:
        seen = f"**stopped early**: {row['samples_seen']} of {crops(row['samples_planned'], row['crop'])}"
    if row["refine_crop"]:
        seen += f"; refinement on {size(row['refine_crop'])} of each"
    if row.get("rate_restarts"):
        seen += f"; rate raised after step {', '.join(map(str, row['rate_restarts']))}"
    return seen


def _pairs(data: dict[str, Any] | None) -> str:
    return f"{data['pairs']} of {data['name']} ({data['sha256'][:8]})" if data else ""
