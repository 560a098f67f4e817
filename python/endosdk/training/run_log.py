"""What a training run leaves to be read beside its checkpoint: a table of its steps and a summary."""

from __future__ import annotations

import csv
import json
import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from endosdk.errors import StorageFailed
from endosdk.io.locks import locked_folder
from endosdk.io.whole_files import remove_partials, write_text

LOG_COLUMNS = ("step", "seconds", "rate", "loss", "epe_coarse", "epe_refined", "volume")


class RunLog:
    """``log.csv`` has a row for every few steps, ``log.json`` the settings, the data and every validation.

    A row has the step that it ends with, and the means over the steps since the row before.
    """

    def __init__(self, folder: Path, last_step: int | None) -> None:
        """Start the table; rows up to ``last_step`` are kept where a run goes on.

        The folder is held until `close`. Raises StorageFailed, and InvalidArgument where another run holds it.
        """
        self._table = folder / "log.csv"
        self._summary = folder / "log.json"
        self._held = ExitStack()
        self._held.enter_context(locked_folder(folder, "out"))
        remove_partials(folder)  # of runs that were killed
        try:
            before = self._table.read_text(errors="replace") if last_step is not None and self._table.exists() else ""
        except OSError as error:
            raise StorageFailed("out", "must be a folder that can be written", error) from error
        # Lines after the checkpoint belong to steps that are taken again. One that a crash has cut short is no line.
        lines = [line for line in before.splitlines()[1:] if _step_of(line) <= (last_step or 0)]
        write_text(self._table, "".join(f"{line}\n" for line in (",".join(LOG_COLUMNS), *lines)), "out")

    def close(self) -> None:
        """Let other runs have the folder."""
        self._held.close()

    def add_step(self, step: int, seconds: float, values: dict[str, float]) -> None:
        """Add the row of a step; ``values`` may lack those of `LOG_COLUMNS` that it has not computed."""
        row = {"step": step, "seconds": round(seconds, 1), **values}
        try:
            with self._table.open("a", newline="") as file:
                csv.DictWriter(file, LOG_COLUMNS, restval="", lineterminator="\n").writerow(row)
        except OSError as error:
            raise StorageFailed("out", "must be a folder that can be written", error) from error

    def write_summary(self, config: dict[str, Any], dataset: dict[str, Any], history: list[dict[str, float]]) -> None:
        """Write the summary anew."""
        summary = {"config": config, "dataset": dataset, "validation": history}
        write_text(self._summary, json.dumps(summary, indent=1) + "\n", "out")


def _step_of(line: str) -> float:
    """Return the step of a row; infinity where it is none."""
    step = line.split(",", 1)[0]
    return int(step) if line.count(",") == len(LOG_COLUMNS) - 1 and step.isdecimal() else math.inf
