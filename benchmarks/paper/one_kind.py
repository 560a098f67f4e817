"""One table, one kind of record: what was measured on other data or trained otherwise is refused by name."""

from __future__ import annotations

from typing import Any

from benchmarks.paper.experiments import EXPERIMENTS, PROTOCOLS
from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument


def check_same_set(file: str, record: dict[str, Any], reader: DatasetReader) -> None:
    """Raise InvalidArgument when a table is about other data than those that are to be scored."""
    if record.get("sha256") != reader.sha256:
        known = f"{record.get('dataset')} {str(record.get('sha256'))[:16]}"
        rule = f"must be the set of {file}, {known}; name another --table"
        raise InvalidArgument("test-data", rule, f"{reader.name} {reader.sha256[:16]}")


def check_one_kind(file: str, rows: dict[str, dict[str, Any]]) -> None:
    """Raise InvalidArgument, naming the run, when rows of one table are of different kinds.

    All trained rows have one precision, one budget and one training set (runs that learn from the test pairs have one
    of their own); rows of one protocol agree in every setting of it that their experiment does not change. What an
    older record does not say is not compared.
    """
    runs = {run.name: run for run in EXPERIMENTS}
    seen: dict[tuple[Any, ...], tuple[str, Any]] = {}

    def compare(what: str, name: str, value: Any, *among: Any) -> None:
        if value is None:
            return
        value = list(value) if isinstance(value, tuple) else value  # as JSON has it
        first, expected = seen.setdefault((what, *among), (name, value))
        if value != expected:
            raise InvalidArgument("record", f"{name} must have the {what} of {first} in {file}, {expected}", value)

    for name, row in rows.items():
        if name not in runs or row is None:
            continue
        run, protocol = runs[name], row.get("protocol")
        if protocol is not None and protocol != run.protocol:
            raise InvalidArgument("record", f"{name} must have the protocol {run.protocol} in {file}", protocol)
        compare("precision", name, row.get("precision"))
        compare("budget", name, row.get("budget"))
        compare("training set", name, row.get("train_data", {}).get("sha256"), run.with_test)
        for key in PROTOCOLS[run.protocol].keys() - run.changes.keys() - {"seed"}:
            compare(key, name, row.get("settings", {}).get(key), run.protocol)
