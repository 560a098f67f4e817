"""The training runs: what is planned, what it costs, how far it has come, and taking it further."""

from __future__ import annotations

import csv
import hashlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import benchmarks.methods.networks  # noqa: F401  makes the other networks known
from benchmarks.methods.costs import step_gmacs
from benchmarks.methods.published import PublishedNetwork
from benchmarks.paper.experiments import Experiment
from benchmarks.paper.joined_set import with_test_pairs
from endosdk import _core
from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.train import Watch, train
from endosdk.training.validation import predict_frames

# Settings that say where and how long a run computes, not what it is.
FREE = (
    *("data", "layout", "steps", "validate_every", "log_every", "refine_from_step"),
    *("device", "precision", "workers", "threads"),
)

TEST_ERRORS = ("test_epe", "test_epe_in_range")  # what is measured after each epoch, px


@dataclass(frozen=True)
class RunState:
    """How far a run has come."""

    name: str
    protocol: str
    budget: str
    folder: Path
    sha256: str  # of the checkpoint: a run that was begun anew has other weights after as many steps
    step: int
    steps: int  # of the whole budget
    config: TrainConfig
    refine_margin: int  # px beyond its window that the refinement saw of the coarse map; 0: zeros
    trained_on: dict[str, Any]  # name, sha256 and pairs of the data set
    precision: str | None  # None: a run from before it was noted
    hours: float
    history: list[dict[str, float]]  # what was measured on the test pairs while it trained

    @property
    def samples_seen(self) -> int:
        """Crops trained on so far."""
        return self.step * self.config.batch

    @property
    def samples_planned(self) -> int:
        """Crops of the whole budget."""
        return self.steps * self.config.batch

    @property
    def complete(self) -> bool:
        """Whether the whole budget was used."""
        return self.step >= self.steps


def config_of(experiment: Experiment, data: Path, layout: str, budget: str, overrides: dict[str, Any]) -> TrainConfig:
    """Return the settings of a run; where it goes by epochs, something may be measured after each."""
    settings = experiment.settings(budget, overrides)
    every = max(1, settings["steps"] // settings.get("epochs", 1))
    # Rows of the log end with every epoch: so each has its loss.
    often = {"validate_every": every, "log_every": max(n for n in range(1, TrainConfig.log_every + 1) if not every % n)}
    return TrainConfig.from_dict({"data": str(data), "layout": layout, **often, **settings})


def state_of(experiment: Experiment, runs: Path, budget: str, overrides: dict[str, Any]) -> RunState | None:
    """Read how far the run has come; None when it has not begun."""
    folder = runs / budget / experiment.name
    if not (folder / checkpoint.LAST).exists():
        return None
    saved = checkpoint.load(folder)
    settings = experiment.settings(budget, overrides)
    check_settings(experiment.name, saved.config, settings)
    return RunState(
        name=experiment.name,
        protocol=experiment.protocol,
        budget=budget,
        folder=folder,
        sha256=hashlib.sha256((folder / checkpoint.LAST).read_bytes()).hexdigest(),
        step=saved.step,
        steps=settings["steps"],
        config=saved.config,
        refine_margin=saved.state.get("refine_margin", 0),
        trained_on=saved.state["dataset"],
        precision=saved.state.get("precision"),
        hours=float(saved.state["seconds"]) / 3600,
        history=saved.state.get("history", []),
    )


def check_settings(name: str, begun: TrainConfig, settings: dict[str, Any]) -> None:
    """Raise InvalidArgument, naming run and setting, when a run was begun with other settings than are wanted."""
    for key, wanted in settings.items():
        if key not in FREE and getattr(begun, key) != wanted:
            rule = f"the run {name} must have {key} {wanted}; move it away, or ask for what it was begun with"
            raise InvalidArgument("runs", rule, getattr(begun, key))


def training_curve(state: RunState) -> dict[str, list[float]] | None:
    """Return loss and test error, px, after each epoch; None for a run that goes by no epochs.

    The loss is the mean over the steps of the epoch that ends there, of which ``loss_steps`` says the number.
    """
    measured = [entry for entry in state.history if "test_epe" in entry]
    if not measured:
        return None
    steps, losses = _logged(state, "loss")
    share = state.config.epochs / state.steps
    of_row = np.diff(steps, prepend=0.0)  # steps that each row of the log is the mean of
    curve: dict[str, list[float]] = {key: [] for key in ("epochs", "loss", "loss_steps", *TEST_ERRORS)}
    for entry in measured:
        within = (steps > entry["step"] - state.config.validate_every) & (steps <= entry["step"])
        curve["epochs"].append(round(entry["step"] * share, 3))
        curve["loss"].append(float(f"{np.average(losses[within], weights=of_row[within]):.6g}"))
        curve["loss_steps"].append(float(of_row[within].sum()))
        for key in TEST_ERRORS:
            curve[key].append(round(entry[key], 4))
    return curve


def rate_restarts(state: RunState) -> list[int]:
    """Return the logged steps after which a run went on at a higher rate: its budget was enlarged once it had ended."""
    steps, rates = _logged(state, "rate")
    rises = np.nonzero(np.diff(rates) > 0)[0] + 1
    return [int(steps[rise]) for rise in rises if steps[rise] > state.config.warmup + state.config.log_every]


def _logged(state: RunState, column: str) -> tuple[np.ndarray, np.ndarray]:
    with (state.folder / "log.csv").open(newline="") as file:
        lines = [line for line in csv.DictReader(file) if int(line["step"]) <= state.step]
    return np.array([float(line["step"]) for line in lines]), np.array([float(line[column]) for line in lines])


def advance(experiment: Experiment, config: TrainConfig, folder: Path, watch: Watch | None = None) -> None:
    """Train a run to its end, from its checkpoint in ``folder`` where there is one."""
    begun = (folder / checkpoint.LAST).exists()
    if begun:
        saved = checkpoint.load(folder)
        check_settings(experiment.name, saved.config, config.as_dict())
        if saved.step >= config.steps:
            print(f"{experiment.name}: done", file=sys.stderr)
            return
    if experiment.with_test and not begun:
        print(f"{experiment.name}: learns from the test pairs too", file=sys.stderr)
    print(f"{experiment.name}: {'resumed' if begun else 'begun'}", file=sys.stderr)
    train(config, folder, resume=begun, watch=watch)


def training_set(experiment: Experiment, data: Path, layout: str, pairs: int, runs: Path) -> Path:
    """Return the folder of the set that a run learns from."""
    if not experiment.with_test:
        return data
    if layout != "endosdk":
        raise InvalidArgument("layout", f"must be endosdk for {experiment.name}, which joins two splits", layout)
    return with_test_pairs(data, pairs, runs / f"joined-{pairs}")


def test_errors(reader: DatasetReader, pairs: int | None) -> Watch:
    """Return what measures a network on the first test pairs: over all truth, and over what its range holds."""
    count = min(pairs or len(reader), len(reader))

    def measure(network: StereoNetwork, refined: bool) -> dict[str, float]:
        largest = (network.max_candidate_disparity or network.max_disparity) - _core.range_margin
        sums = np.zeros((2, 2))
        for frame in predict_frames(network, reader, range(count), refined=refined, title="test pairs"):
            truth = frame.sample.disparity
            error = np.abs(frame.maps[-1] - truth, dtype=np.float64)
            for row, known in enumerate((np.isfinite(truth), truth <= largest)):
                sums[row] += error[known].sum(), known.sum()
        whole, within = (float(total / max(pixels, 1)) for total, pixels in sums)
        return dict(zip(TEST_ERRORS, (whole, within), strict=True))

    return measure


@contextmanager
def limited_to(minutes: float | None) -> Iterator[None]:
    """Raise KeyboardInterrupt in the main thread when the time is over; the run in progress saves itself first.

    A polite kill does the same meanwhile, also before and between runs.
    """
    inside = True

    def stop(number: int, frame: object) -> None:
        if inside:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    timer = threading.Timer(60 * minutes, os.kill, (os.getpid(), signal.SIGTERM)) if minutes else None
    try:
        if timer is not None:
            timer.daemon = True
            timer.start()
        yield
    finally:
        inside = False
        if timer is not None:
            timer.cancel()
            timer.join()
        signal.signal(signal.SIGTERM, before)


def exported(state: RunState) -> Path:
    """Return the model file of a run, written when its checkpoint is a new one."""
    file = model_file(state.folder, state.sha256)
    if not file.exists():
        note = {"samples_seen": state.samples_seen, "samples_planned": state.samples_planned}
        _export(checkpoint.load(state.folder).build(), file, state.name, note)
    return file


def untrained(experiment: Experiment, runs: Path) -> Path:
    """Return a file of the network of a run with random weights, for timings."""
    file = runs / "untrained" / f"{experiment.name}.onnx"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        config = TrainConfig.from_dict({"data": ".", **experiment.settings("gpu", {})})
        _export(checkpoint.configured_network(config).eval(), file, experiment.name, {})
    return file


def _export(network: StereoNetwork, file: Path, name: str, training: dict[str, Any]) -> None:
    info = ModelDescription(name=name, version="1", training=training)
    export_model(network, file, info, size_step=network.input_multiple if isinstance(network, PublishedNetwork) else 1)


def model_file(folder: Path, sha256: str) -> Path:
    """Return where the model file of a run lies, by the hash of its checkpoint."""
    return folder / f"{sha256[:16]}.onnx"


def plan(
    experiments: list[Experiment], runs: Path, budget: str, overrides: dict[str, Any], speeds: dict[str, float]
) -> list[dict[str, Any]]:
    """Cost of each run: 1e9 MACs a step, steps left, and hours at ``speeds`` (1e9 MACs a second, by network)."""
    lines = []
    for experiment in experiments:
        settings = experiment.settings(budget, overrides)
        gmacs = config_gmacs(settings)
        state = state_of(experiment, runs, budget, overrides)
        left = max(0, settings["steps"] - (state.step if state else 0))
        hours = gmacs * left / speeds[settings["network"]] / 3600
        lines.append({"run": experiment.name, "gmacs_per_step": gmacs, "steps_left": left, "hours": hours})
    return lines


def config_gmacs(settings: dict[str, Any]) -> float:
    """1e9 MACs of a training step with these settings, on average: the refinement may join late."""
    network, range_px, crop = settings["network"], settings["max_disparity"], tuple(settings["crop"])
    refined, rough = (
        step_gmacs(network, range_px, crop, settings["batch"], window=settings.get("refine_crop"), refined=which)
        for which in (True, False)
    )
    late = min(1.0, settings.get("refine_from_step", 0) / max(1, settings["steps"]))
    return (1.0 - late) * refined + late * rough
