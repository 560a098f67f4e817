"""Score every method that can answer, and write `table1.json` and `ablations.json`; what was scored is kept."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods.classical import classical_method
from benchmarks.methods.costs import network_costs
from benchmarks.methods.patchmatch import PatchMatchSettings, match
from benchmarks.paper.experiments import CLASSICAL, EXPERIMENTS, LABELS
from benchmarks.paper.runs import RunState, exported, torch_method
from endosdk.baseline import fill_holes
from endosdk.bench import write_record
from endosdk.dataset import DatasetReader, Sample
from endosdk.estimator import DepthEstimator
from endosdk.evaluation import Answer, Method, estimator_method, evaluate
from endosdk.machine import machine_record
from endosdk.models import shipped_models
from endosdk.scores import ScoreBoard

KPE = (1, 2, 3, 5)
RIVALS = ("anynet", "psmnet")


def patchmatch_method(*, filled: bool) -> Method:
    """Return the method that is PatchMatch with the paper's settings."""

    def answer(sample: Sample) -> Answer:
        started = time.perf_counter()
        checked, whole = match(sample.left, sample.right, PatchMatchSettings())
        return Answer(whole if filled else checked, milliseconds=1e3 * (time.perf_counter() - started))

    return answer


def row(scores: dict[str, Any]) -> dict[str, Any]:
    """Reduce the measures of `evaluate` to a row of the table; shares are 0..1, times in ms."""
    whole, visible = scores["all"], scores.get("non_occluded")
    return {
        "epe": whole["epe_px"],
        "kpe": {str(k): whole[f"kpe_{k}"] for k in KPE},
        "epe_noc": visible["epe_px"] if visible else None,
        "kpe_noc": {str(k): visible[f"kpe_{k}"] for k in KPE} if visible else None,
        "coverage": whole["coverage"],
        "depth_mae_mm": whole.get("depth_mae_mm"),
        "pixels": whole["pixels"],
        "pairs": scores["pairs"],
        "ms": scores["ms_median"],
    }


class Scores:
    """Rows by method, kept in a file beside the runs so that nothing is scored twice."""

    def __init__(self, file: Path, reader: DatasetReader, limit: int | None) -> None:
        self.file, self.reader, self.limit = file, reader, limit
        self.rows: dict[str, dict[str, Any]] = json.loads(file.read_text()) if file.exists() else {}

    def get(self, name: str, mark: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the row of a method whose state is ``mark``; ``make`` it unless it is there for the same data."""
        key = f"{mark} on {self.reader.sha256[:16]}, {self.limit or len(self.reader)} pairs"
        kept = self.rows.get(name)
        if kept is None or kept["key"] != key:
            print(f"scoring {name}", file=sys.stderr)
            self.rows[name] = kept = {"key": key, "row": make()}
            write_record(self.file, self.rows)
        return dict(kept["row"])

    def score(self, method: Method) -> dict[str, Any]:
        """Run a method over the split."""
        return row(evaluate(method, self.reader, self.limit))


def classical_rows(scores: Scores, best: dict[str, Any] | None) -> dict[str, dict[str, Any]]:
    """Score the matchers of OpenCV, filled (as the networks answer) and as they are."""
    rows = {}
    for name, fixed in CLASSICAL.items():
        settings = fixed if fixed is not None else best
        if settings is None:
            continue  # the search has not been run

        def make(name: str = name, settings: dict[str, Any] = settings) -> dict[str, Any]:
            return {**_filled_and_bare(scores, classical_method(name, settings, filled=False)), "settings": settings}

        rows[name] = scores.get(name, json.dumps(settings, sort_keys=True), make)
    return rows


def _filled_and_bare(scores: Scores, method: Method) -> dict[str, Any]:
    """Score a matcher that leaves holes both ways in one pass: filled, and as ``unfilled`` on what it answers."""
    bare = ScoreBoard()

    def filled(sample: Sample) -> Answer:
        answer = method(sample)
        camera = {"focal_px": sample.focal_px, "baseline_mm": sample.baseline_mm, "doffs": sample.doffs}
        bare.add(answer.disparity, sample.disparity, occlusion=sample.occlusion, **camera)
        return replace(answer, disparity=fill_holes(answer.disparity))

    whole = scores.score(filled)
    return {**whole, "unfilled": row({**bare.result(), "ms_median": whole["ms"]})}


def patchmatch_rows(scores: Scores) -> dict[str, dict[str, Any]]:
    """Score PatchMatch: minutes a pair, so only when it is asked for."""

    def make() -> dict[str, Any]:
        return {**scores.score(patchmatch_method(filled=True)), "settings": vars(PatchMatchSettings())}

    return {"patchmatch": scores.get("patchmatch", str(PatchMatchSettings()), make)}


def shipped_rows(scores: Scores, size: tuple[int, int], wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Score the models that come with the package; they saw more data than the protocol's 800 pairs."""
    rows = {}
    for name in ("wang2020", "fast"):
        if f"shipped-{name}" not in wanted or name not in shipped_models():
            continue
        model = DepthEstimator(name).model
        found = scores.get(f"shipped-{name}", model.sha256, lambda name=name: scores.score(estimator_method(name)))
        costs = network_costs(name, model.max_disparity, size[1], size[0])
        known = {"params": costs.params, "gmacs": costs.gmacs, "trained_on": model.training.get("data")}
        rows[f"shipped-{name}"] = {**found, **known}
    return rows


def trained_row(scores: Scores, state: RunState, size: tuple[int, int]) -> dict[str, Any]:
    """Score one run: ours through the exported file, which is what is deployed and timed; rivals by torch."""

    def make() -> dict[str, Any]:
        if state.network in RIVALS:
            return {**scores.score(torch_method(state)), "runtime": "torch"}
        return {**scores.score(estimator_method(str(exported(state)))), "runtime": "onnxruntime"}

    found = scores.get(state.name, f"step {state.step}", make)
    costs = network_costs(state.network, state.max_disparity, size[1], size[0])
    return {
        **found,
        "params": costs.params,
        "gmacs": costs.gmacs,
        "samples_seen": state.samples_seen,
        "samples_planned": state.samples_planned,
        "complete": state.complete,
    }


def write_table(file: Path, reader: DatasetReader, rows: dict[str, dict[str, Any]]) -> None:
    """Write the rows of Table 1; methods that have not been run are listed by name, without numbers."""
    if file.exists():  # rows of the same pairs that were not asked for this time stay
        before = json.loads(file.read_text())
        rows = {**(before["methods"] if before["sha256"] == reader.sha256 else {}), **rows}
    record = {
        "dataset": reader.name,
        "sha256": reader.sha256,
        "pairs": len(reader),
        "threads": len(os.sched_getaffinity(0)),
        "methods": {name: {"params": None, "gmacs": None, **values} for name, values in rows.items()},
        "not_yet_run": [name for name in LABELS if name not in rows],
        "machine": machine_record(),
    }
    write_record(file, record)


def write_ablations(file: Path, reader: DatasetReader, rows: dict[str, dict[str, Any]]) -> None:
    """Write the rows of every group of runs, by label; None where a run is missing."""
    groups: dict[str, dict[str, Any]] = {}
    for experiment in EXPERIMENTS:
        groups.setdefault(experiment.group, {})[experiment.label] = rows.get(experiment.name)
    write_record(file, {"dataset": reader.name, "pairs": len(reader), "groups": groups, "machine": machine_record()})


def retime_table(file: Path, reader: DatasetReader, runs: Path, only: list[str] | None) -> None:
    """Time every method of the table again, alone on the machine and quickly; the scores stay."""
    table = json.loads(file.read_text())
    for name, values in table["methods"].items():
        if only and name not in only:
            continue
        method = method_of(name, values, runs)
        if method is not None:
            values["ms"] = retime(method, reader)
            if "unfilled" in values:
                values["unfilled"]["ms"] = values["ms"]
            print(f"{name:18} {values['ms']:8.1f} ms")
    # Work of others beside the timing shows here: above the number of threads the times are too long.
    table["load_while_timed"] = os.getloadavg()[0]
    table["machine"] = machine_record()
    write_record(file, table)


def method_of(name: str, values: dict[str, Any], runs: Path) -> Method | None:
    """Return the method of a row of the table; None when its run is not here, or it takes minutes a pair."""
    if name in CLASSICAL:
        return classical_method(name, values["settings"], filled=False)
    if name.startswith("shipped-"):
        return estimator_method(name.removeprefix("shipped-"))
    files = sorted((runs / name).glob("step*.onnx"), key=lambda path: int(path.stem.removeprefix("step")))
    return estimator_method(str(files[-1])) if files else None


def retime(method: Method, reader: DatasetReader, pairs: int = 3, repeats: int = 3) -> float:
    """Median time of a method, ms, on a few pairs after one that warms up."""
    samples = [reader[i] for i in range(min(pairs, len(reader)))]
    method(samples[0])
    return float(np.median([method(sample).milliseconds for _ in range(repeats) for sample in samples]))
