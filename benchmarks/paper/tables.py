"""Score every method that can answer, and write `table1.json` and `ablations.json`; what was scored is kept."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods.classical import classical_method
from benchmarks.methods.costs import network_costs
from benchmarks.methods.kept_patchmatch import fresh_match, kept_match
from benchmarks.methods.patchmatch import PatchMatchSettings
from benchmarks.paper.experiments import CLASSICAL, EXPERIMENTS, LABELS, PROTOCOLS, RANGES, rows_by_name
from benchmarks.paper.one_kind import check_one_kind, check_same_set
from benchmarks.paper.rows import row
from benchmarks.paper.runs import (
    RunState,
    config_gmacs,
    exported,
    model_file,
    rate_restarts,
    training_curve,
    untrained,
)
from benchmarks.paper.stages import stage_errors
from benchmarks.record import NO_MODEL, Hashes, write_record
from benchmarks.turns import answers_in_turns
from endosdk import _core
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import Answer, Method, estimator_method, evaluate
from endosdk.evaluation.scores import ScoreBoard
from endosdk.evaluation.sgbm import fill_holes
from endosdk.io.whole_files import write_json
from endosdk.jobs.machine import machine_record
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.models import shipped_models, shipped_weights
from endosdk.training import checkpoint

# What the smallest range of the ablations holds: only there can all ranges be compared.
COMMON_PX = min(RANGES) - _core.range_margin


class Scores:
    """Rows by method, kept in a file beside the runs so that nothing is scored twice."""

    def __init__(self, file: Path, reader: DatasetReader, limit: int | None) -> None:
        self.file, self.reader, self.limit = file, reader, limit
        self.rows = self._read()

    def _read(self) -> dict[str, dict[str, Any]]:
        return json.loads(self.file.read_text()) if self.file.exists() else {}

    @property
    def pairs(self) -> int:
        """How many pairs a method is scored on."""
        return min(self.limit or len(self.reader), len(self.reader))

    def on_first(self, pairs: int | None) -> Scores:
        """Return the same scores, on the first so many pairs where no other number was asked for."""
        fewer = copy(self)
        fewer.limit = self.limit or pairs
        return fewer

    def get(self, name: str, mark: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the row of a method whose state is ``mark``; ``make`` it unless it is there for the same data."""
        split = "" if self.reader.split == "test" else f" {self.reader.split}"  # the hash is that of the whole set
        place = f"{name} on {self.reader.sha256[:16]}{split}, {self.pairs} pairs"
        kept = self.rows.get(place)
        if kept is None or kept["key"] != mark:
            print(f"scoring {name}", file=sys.stderr)
            kept = {"key": mark, "row": make()}
            # Read again: scoring takes long, and other methods may have been scored beside it.
            self.rows = {**self._read(), place: kept}
            write_json(self.file, self.rows)
        return dict(kept["row"])

    def score(self, method: Method) -> dict[str, Any]:
        """Run a method over the split; the row says where and when, because it is kept beside rows of other runs."""
        here = timing_of(machine_record())
        board = ScoreBoard()

        def watched(sample: Sample) -> Answer:
            answer = method(sample)
            board.add(answer.disparity, sample.disparity, largest_px=COMMON_PX)
            return answer

        found = row(evaluate(watched, self.reader, self.limit))
        common = row({**board.result(), "ms_median": found["ms"]})["epe_in_range"]
        return {**found, "epe_common": common, "scored_on": here, "timed_on": here}


def classical_rows(scores: Scores, best: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Score the matchers of OpenCV, filled (as the networks answer) and as they are; ``best`` settings by method."""
    rows = {}
    for name, fixed in CLASSICAL.items():
        settings = fixed if fixed is not None else best.get(name)
        if settings is None:
            continue  # the search has not been run

        def make(name: str = name, settings: dict[str, Any] = settings) -> dict[str, Any]:
            bare = classical_method(name, settings, filled=False)
            return {**filled_and_bare(scores, lambda sample: with_holes_filled(bare(sample))), "settings": settings}

        rows[name] = scores.get(name, json.dumps(settings, sort_keys=True), make)
    return rows


def with_holes_filled(bare: Answer) -> tuple[Answer, Answer]:
    """Return the answer twice: answering everywhere, as the networks do, and as it is."""
    return replace(bare, disparity=fill_holes(bare.disparity)), bare


def filled_and_bare(scores: Scores, method: Callable[[Sample], tuple[Answer, Answer]]) -> dict[str, Any]:
    """Score a matcher that leaves holes both ways in one pass: filled, and as ``unfilled`` on what it answers."""
    board = ScoreBoard()

    def filled(sample: Sample) -> Answer:
        whole, bare = method(sample)
        camera = {"focal_px": sample.focal_px, "baseline_mm": sample.baseline_mm, "doffs": sample.doffs}
        board.add(bare.disparity, sample.disparity, occlusion=sample.occlusion, **camera)
        return whole

    found = scores.score(filled)
    return {**found, "unfilled": row({**board.result(), "ms_median": found["ms"]})}


def patchmatch_rows(scores: Scores, runs: Path) -> dict[str, dict[str, Any]]:
    """Score PatchMatch with its paper's settings."""
    settings = PatchMatchSettings()
    method = kept_match(patchmatch_folder(runs, scores.reader), settings)

    def make() -> dict[str, Any]:
        return {**filled_and_bare(scores, method), "settings": vars(settings)}

    return {"patchmatch": scores.get("patchmatch", str(settings), make)}


def patchmatch_folder(runs: Path, reader: DatasetReader) -> Path:
    """Return where the answers to a set's pairs are kept."""
    return runs / "patchmatch" / reader.sha256[:16]


def learned_from(training: dict[str, Any]) -> dict[str, Any] | None:
    """Return the set that the weights of a model file come from: a run of no steps only fitted their confidence."""
    before = None if training.get("steps_done") else training.get("init")
    return before["data"] if before else training.get("data")


def shipped_rows(
    scores: Scores, size: tuple[int, int], wanted: set[str], learned: Scores | None
) -> dict[str, dict[str, Any]]:
    """Score the models that come with the package; they saw more data than the protocol's 800 pairs.

    With ``learned`` the error on training pairs is taken too.
    """
    rows = {}
    # The answers are those of the whole frame path, most of which is compiled.
    core = hashlib.sha256(Path(_core.__file__).read_bytes()).hexdigest()
    for name in ("wang2020", "fast"):
        if f"shipped-{name}" not in wanted or name not in shipped_models():
            continue
        model = DepthEstimator(name).model
        state = f"{model.sha256}, core {core}"
        found = scored_with_learned(f"shipped-{name}", state, lambda name=name: name, scores, learned)
        config = checkpoint.load(shipped_weights()[name]).config
        costs = network_costs(name, model.max_disparity, size[1], size[0], dense_disparity=config.dense_disparity)
        known = {"params": costs.params, "gmacs": costs.gmacs, "trained_on": learned_from(model.training)}
        known |= {"output_stride": model.output_stride, "version": model.version, "model_sha256": model.sha256}
        rows[f"shipped-{name}"] = {**found, **known}
    return rows


def scored_with_learned(
    place: str, mark: str, model: Callable[[], str], scores: Scores, learned: Scores | None
) -> dict[str, Any]:
    """Return the row of a network on the test pairs, with its error on training pairs where these are given."""

    def score(which: Scores) -> dict[str, Any]:
        return which.score(estimator_method(model()))

    found = scores.get(place, mark, lambda: score(scores))
    if learned is None:
        return found
    seen = learned.get(place, mark, lambda: score(learned))
    return {**found, "train_epe": seen["epe"], "train_pairs_scored": learned.pairs}


def trained_row(scores: Scores, state: RunState, size: tuple[int, int], learned: Scores | None) -> dict[str, Any]:
    """Score one run through its exported file, which is what is deployed and timed.

    With ``learned`` the error on training pairs is taken too.
    """
    place, config = f"{state.budget}/{state.name}", state.config

    def stages() -> dict[str, Any]:
        return {"epe": stage_errors(checkpoint.load(state.folder).build(), scores.reader, scores.pairs)}

    found = scored_with_learned(place, state.sha256, lambda: str(exported(state)), scores, learned)
    if config.network == "anynet":  # the one that answers at any stage
        found["stages"] = scores.get(f"{place}, stages", state.sha256, stages)["epe"]
    costs = network_costs(config.network, config.max_disparity, size[1], size[0])
    curve = training_curve(state)
    plain = config.as_dict()
    return {
        **found,
        "protocol": state.protocol,
        "settings": {key: plain[key] for key in PROTOCOLS[state.protocol]},
        "precision": state.precision,
        "hours": round(state.hours, 3),
        "seed": config.seed,
        "rate_restarts": rate_restarts(state),
        "last_loss": curve["loss"][-1] if curve else None,
        "params": costs.params,
        "gmacs": costs.gmacs,
        "budget": state.budget,
        "checkpoint_sha256": state.sha256,
        "samples_seen": state.samples_seen,
        "samples_planned": state.samples_planned,
        "complete": state.complete,
        "training_tmacs": config_gmacs(config.as_dict()) * state.step / 1e3,
        "crop": config.crop,
        "refine_crop": config.refine_crop,
        "refine_margin": state.refine_margin,
        "train_pairs": config.train_pairs,
        "train_data": state.trained_on,
        "curve": curve,
    }


def write_table(file: Path, scores: Scores, rows: dict[str, dict[str, Any]]) -> None:
    """Write the rows of Table 1; methods that have not been run are listed by name, without numbers."""
    reader = scores.reader
    before = _before(file, scores)
    # Rows of the same pairs that were not asked for this time stay, with the machine on which they were timed.
    kept_rows = {
        name: {"timed_on": timing_of(before["machine"]), **values} for name, values in before.get("methods", {}).items()
    }
    rows = {**kept_rows, **rows}
    check_one_kind(file.name, rows)
    record = {
        "dataset": reader.name,
        "sha256": reader.sha256,
        "pairs": scores.pairs,
        "threads": len(os.sched_getaffinity(0)),
        "methods": {name: {"params": None, "gmacs": None, **values} for name, values in rows.items()},
        "not_yet_run": [name for name in LABELS if name not in rows],
    }
    kept = {key: before[key] for key in ("load_while_timed",) if key in before}
    write_record(file, {**record, **kept}, command=_command(scores), hashes=shipped_hashes(rows))


def shipped_hashes(rows: dict[str, dict[str, Any]]) -> Hashes:
    """Return the hashes of the shipped models among the rows; runs have those of their checkpoints in their rows."""
    return {"model_sha256": {name: row["model_sha256"] for name, row in rows.items() if "model_sha256" in row}}


def timing_of(machine: dict[str, Any]) -> dict[str, Any]:
    """Return what of a machine's record decides how long a method takes, with commit and date where it knows them.

    Older records do not know the instructions.
    """
    known: dict[str, Any] = {key: machine[key] for key in ("commit", "date") if key in machine}
    return {"cpu": machine["cpu"], "instructions": machine.get("instructions"), **known}


def write_ablations(file: Path, scores: Scores, rows: dict[str, dict[str, Any]]) -> None:
    """Write the rows of every group of ablations, by label; None where a run is missing."""
    reader = scores.reader
    before = _before(file, scores).get("groups", {})
    groups: dict[str, dict[str, Any]] = {}
    for run in EXPERIMENTS:
        if run.group == "table1":
            continue
        kept = before.get(run.group, {}).get(run.label)
        groups.setdefault(run.group, {})[run.label] = rows.get(run.name, kept)
    check_one_kind(file.name, rows_by_name(groups))
    record = {"dataset": reader.name, "sha256": reader.sha256, "pairs": scores.pairs, "groups": groups}
    # Runs have their files' hashes in their rows: no shipped model is among them.
    write_record(file, record, command=_command(scores), hashes=NO_MODEL)


def _command(scores: Scores) -> str:
    some = "" if scores.limit is None else f" --pairs {scores.limit}"
    return f"python -m benchmarks.paper evaluate --test-data {scores.reader.name}{some}"


def _before(file: Path, scores: Scores) -> dict[str, Any]:
    """Return what the file says. Raises InvalidArgument when it is about another set."""
    record = dict(json.loads(file.read_text())) if file.exists() else {}
    if record:
        check_same_set(file.name, record, scores.reader)
    return record


def check_same_pairs(file: Path, scores: Scores) -> None:
    """Raise before anything is scored if the rows could not join those of the file: other pairs do not compare."""
    pairs = _before(file, scores).get("pairs", scores.pairs)
    if pairs != scores.pairs:
        raise InvalidArgument("pairs", f"must be {pairs}, as in {file.name}", scores.pairs)


def retime_table(file: Path, reader: DatasetReader, runs: Path, only: list[str] | None) -> None:
    """Time every method of the table again, alone on the machine and quickly; the scores stay, and what they are of.

    PatchMatch is timed on one pair, and only when it is named.
    """
    table = json.loads(file.read_text())
    machine = machine_record()
    for values in table["methods"].values():
        values.setdefault("timed_on", timing_of(table["machine"]))
    rows = {name: values for name, values in table["methods"].items() if name in only} if only else table["methods"]
    methods = {name: timed_method(name, values, runs) for name, values in rows.items() if only or name != "patchmatch"}
    for name, milliseconds in retime({name: found for name, found in methods.items() if found}, reader).items():
        rows[name].update(ms=milliseconds, timed_on=timing_of(machine))
        if "unfilled" in rows[name]:
            rows[name]["unfilled"]["ms"] = milliseconds
        print(f"{name:18} {milliseconds:8.1f} ms")
    # Work of others beside the timing shows here: above the number of threads the times are too long.
    table["load_while_timed"] = os.getloadavg()[0]
    write_json(file, table)


def method_of(name: str, values: dict[str, Any], runs: Path) -> Method | None:
    """Return the method of a row of the table; None when its run is not here."""
    if name == "patchmatch":
        matched = fresh_match(PatchMatchSettings())
        return lambda sample: matched(sample)[0]
    if name in CLASSICAL:
        return classical_method(name, values["settings"], filled=False)
    if name.startswith("shipped-"):
        return estimator_method(name.removeprefix("shipped-"))
    if "checkpoint_sha256" not in values:
        return None
    file = model_file(runs / values["budget"] / name, values["checkpoint_sha256"])
    return estimator_method(str(file)) if file.exists() else None


def timed_method(name: str, values: dict[str, Any], runs: Path) -> Method | None:
    """Return the method of a row to time. Without its run it is the same network untrained, which takes as long."""
    planned = [run for run in EXPERIMENTS if run.name == name]
    found = method_of(name, values, runs)
    return estimator_method(str(untrained(planned[0], runs))) if found is None and planned else found


def retime(methods: dict[str, Method], reader: DatasetReader, pairs: int = 3, repeats: int = 3) -> dict[str, float]:
    """Median time of every method, ms, on a few pairs; PatchMatch, which takes minutes, answers one pair once."""
    samples = [reader[i] for i in range(min(pairs, len(reader)))]
    quick = {name: method for name, method in methods.items() if name != "patchmatch"}
    times: dict[str, list[float]] = {name: [] for name in quick}
    for name, _, answer in answers_in_turns(quick, samples * repeats):
        times[name].append(answer.milliseconds)
    medians = {name: float(np.median(values)) for name, values in times.items()}
    slow = {name: methods[name](samples[0]).milliseconds for name in methods.keys() - quick.keys()}
    return {**medians, **slow}
