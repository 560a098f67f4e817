"""What a training run leaves to be read beside its checkpoint: a table of its steps and a summary."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

from endosdk.errors import StorageFailed

LOG_COLUMNS = ("step", "seconds", "rate", "loss", "epe_coarse", "epe_refined", "volume")


class RunLog:
    """``log.csv`` has a row for every few steps, ``log.json`` the settings, the data and every validation."""

    def __init__(self, folder: Path, last_step: int | None) -> None:
        """Start the table; rows up to ``last_step`` are kept where a run goes on. Raises StorageFailed."""
        self._table = folder / "log.csv"
        self._summary = folder / "log.json"
        rows: list[list[str]] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if last_step is not None and self._table.exists():
                with self._table.open(newline="") as file:
                    # Lines after the checkpoint belong to steps that are taken again.
                    rows = [row for row in list(csv.reader(file))[1:] if int(row[0]) <= last_step]
            with self._table.open("w", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([LOG_COLUMNS, *rows])
        except OSError as error:
            raise StorageFailed("out", "must be a folder that can be written", error) from error

    def add_step(self, step: int, seconds: float, values: dict[str, float]) -> None:
        """Add the row of a step; ``values`` may lack those of `LOG_COLUMNS` that it has not computed."""
        with self._table.open("a", newline="") as file:
            row = {"step": step, "seconds": round(seconds, 1), **values}
            csv.DictWriter(file, LOG_COLUMNS, restval="", lineterminator="\n").writerow(row)

    def write_summary(self, config: dict[str, Any], dataset: dict[str, Any], history: list[dict[str, float]]) -> None:
        """Write the summary anew."""
        summary = {"config": config, "dataset": dataset, "validation": history}
        self._summary.write_text(json.dumps(summary, indent=1) + "\n")
