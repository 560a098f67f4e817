"""The training runs: what is planned, what it costs, how far it has come, and taking it further."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

import benchmarks.methods.networks  # noqa: F401  makes the rivals known
from benchmarks.methods.costs import BACKWARD_FACTOR, count_macs, step_gmacs
from benchmarks.paper.experiments import Experiment
from endosdk.dataset import Sample
from endosdk.evaluation import Answer, Method
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.data import planar
from endosdk.training.evaluate import pad_to_multiple
from endosdk.training.export import ModelInfo, export_model
from endosdk.training.networks import build_network
from endosdk.training.train import train


@dataclass(frozen=True)
class RunState:
    """How far a run has come."""

    name: str
    folder: Path
    network: str
    max_disparity: int
    step: int
    steps: int
    batch: int

    @property
    def samples_seen(self) -> int:
        """Crops trained on so far."""
        return self.step * self.batch

    @property
    def samples_planned(self) -> int:
        """Crops of the whole budget."""
        return self.steps * self.batch

    @property
    def complete(self) -> bool:
        """Whether the whole budget was used."""
        return self.step >= self.steps


def config_of(experiment: Experiment, data: Path, layout: str, overrides: dict[str, Any]) -> TrainConfig:
    """Return the settings of a run; nothing is validated while it trains, since the test split is scored after."""
    settings = experiment.settings(overrides)
    steps = settings["steps"]
    return TrainConfig.from_dict({"data": str(data), "layout": layout, "validate_every": steps, **settings})


def state_of(experiment: Experiment, runs: Path, planned: dict[str, Any]) -> RunState | None:
    """Read how far the run has come; None when it has not begun."""
    folder = runs / experiment.name
    if not (folder / checkpoint.LAST).exists():
        return None
    saved = checkpoint.load(folder)
    config = saved.config
    steps = experiment.settings(planned)["steps"]
    return RunState(experiment.name, folder, config.network, config.max_disparity, saved.step, steps, config.batch)


def advance(experiment: Experiment, config: TrainConfig, runs: Path) -> None:
    """Train a run to its end, from its checkpoint where there is one."""
    folder = runs / experiment.name
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
    """Return the model file of a run, written anew when the run has gone on since."""
    file = state.folder / f"step{state.step}.onnx"
    if not file.exists():
        network = checkpoint.load(state.folder).build()
        note = {"samples_seen": state.samples_seen, "samples_planned": state.samples_planned}
        export_model(network, file, ModelInfo(name=state.name, version="1", training=note))
    return file


def torch_method(state: RunState) -> Method:
    """Answer by torch on the processor: for networks whose export is not proven yet; their time is torch's."""
    network = checkpoint.load(state.folder).build()

    def answer(sample: Sample) -> Answer:
        height, width = sample.left.shape[:2]
        views = (planar(view)[None].float() for view in (sample.left, sample.right))
        left, right = (pad_to_multiple(view, network.input_multiple) for view in views)
        started = time.perf_counter()
        with torch.inference_mode():
            found = network(left, right).disparities[-1]
        elapsed = 1e3 * (time.perf_counter() - started)
        return Answer(found[0, 0, :height, :width].numpy(), milliseconds=elapsed)

    return answer


def plan(experiments: list[Experiment], runs: Path, overrides: dict[str, Any], speed: float) -> list[dict[str, Any]]:
    """Cost of each run: 1e9 MACs a step, steps left, and hours at ``speed`` (1e9 MACs a second)."""
    lines = []
    for experiment in experiments:
        settings = experiment.settings(overrides)
        gmacs = step_gmacs(settings["network"], settings["max_disparity"], tuple(settings["crop"]), settings["batch"])
        state = state_of(experiment, runs, overrides)
        left = max(0, settings["steps"] - (state.step if state else 0))
        hours = gmacs * left / speed / 3600
        lines.append({"run": experiment.name, "gmacs_per_step": gmacs, "steps_left": left, "hours": hours})
    return lines


def measure_speed(device: str, crop: tuple[int, int] = (128, 256)) -> float:
    """1e9 MACs a second that training reaches here, from one forward and backward pass of wang2020."""
    network = build_network("wang2020", 72).to(device).train()
    views = torch.rand(2, 1, 3, *crop, device=device) * 255
    elapsed = 0.0
    for _ in range(2):  # the first warms up
        started = time.perf_counter()
        network(views[0], views[1]).disparities[-1].mean().backward()
        if device != "cpu":
            torch.cuda.synchronize()
        elapsed = time.perf_counter() - started
    return BACKWARD_FACTOR * count_macs("wang2020", 72, *crop) / 1e9 / elapsed
