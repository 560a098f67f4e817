"""The training runs: what is planned, what it costs, how far it has come, and taking it further."""

from __future__ import annotations

import csv
import hashlib
import os
import signal
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import benchmarks.methods.networks  # noqa: F401  makes the rivals known
from benchmarks.methods.costs import step_gmacs
from benchmarks.methods.rival import RivalNetwork
from benchmarks.paper.experiments import Experiment
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.export import ModelInfo, export_model
from endosdk.training.train import train


@dataclass(frozen=True)
class RunState:
    """How far a run has come."""

    name: str
    budget: str
    folder: Path
    sha256: str  # of the checkpoint: a run that was begun anew has other weights after as many steps
    step: int
    steps: int  # of the whole budget
    config: TrainConfig
    refine_margin: int  # px beyond its window that the refinement saw of the coarse map; 0: zeros
    trained_on: dict[str, Any]  # name, sha256 and pairs of the data set

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
    """Return the settings of a run; nothing is validated while it trains, since the test split is scored after."""
    settings = experiment.settings(budget, overrides)
    steps = settings["steps"]
    return TrainConfig.from_dict({"data": str(data), "layout": layout, "validate_every": steps, **settings})


def state_of(experiment: Experiment, runs: Path, budget: str, overrides: dict[str, Any]) -> RunState | None:
    """Read how far the run has come; None when it has not begun."""
    folder = runs / budget / experiment.name
    if not (folder / checkpoint.LAST).exists():
        return None
    saved = checkpoint.load(folder)
    steps = experiment.planned(budget, overrides)["steps"]
    return RunState(
        name=experiment.name,
        budget=budget,
        folder=folder,
        sha256=hashlib.sha256((folder / checkpoint.LAST).read_bytes()).hexdigest(),
        step=saved.step,
        steps=steps,
        config=saved.config,
        refine_margin=saved.state.get("refine_margin", 0),
        trained_on=saved.state["dataset"],
    )


def training_curve(state: RunState) -> dict[str, list[float]]:
    """Read from a run's log the steps and the error, px, of its finest map on each step's crops."""
    with (state.folder / "log.csv").open(newline="") as file:
        lines = [line for line in csv.DictReader(file) if int(line["step"]) <= state.step]
    errors = [float(line["epe_refined"] or line["epe_coarse"]) for line in lines]
    return {"steps": [int(line["step"]) for line in lines], "epe": [round(error, 4) for error in errors]}


def advance(experiment: Experiment, config: TrainConfig, folder: Path) -> None:
    """Train a run to its end, from its checkpoint in ``folder`` where there is one."""
    begun = (folder / checkpoint.LAST).exists()
    if begun and checkpoint.load(folder).step >= config.steps:
        print(f"{experiment.name}: done", file=sys.stderr)
        return
    print(f"{experiment.name}: {'resumed' if begun else 'begun'}", file=sys.stderr)
    train(config, folder, resume=begun)


def stop_after(minutes: float) -> threading.Timer:
    """Ask this process to end politely after a while: the run in progress saves its checkpoint first."""
    timer = threading.Timer(60 * minutes, os.kill, (os.getpid(), signal.SIGTERM))
    timer.daemon = True
    timer.start()
    return timer


def exported(state: RunState) -> Path:
    """Return the model file of a run, written when its checkpoint is a new one."""
    file = model_file(state.folder, state.sha256)
    if not file.exists():
        network = checkpoint.load(state.folder).build()
        note = {"samples_seen": state.samples_seen, "samples_planned": state.samples_planned}
        info = ModelInfo(name=state.name, version="1", training=note)
        export_model(network, file, info, size_step=network.input_multiple if isinstance(network, RivalNetwork) else 1)
    return file


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
    """1e9 MACs of one training step with these settings."""
    part = {"window": settings.get("refine_crop"), "refined": settings.get("refine_from_step", 0) < settings["steps"]}
    return step_gmacs(
        settings["network"], settings["max_disparity"], tuple(settings["crop"]), settings["batch"], **part
    )
