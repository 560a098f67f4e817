"""How quickly this machine trains each network: one step timed alone, so that a plan states hours that come true."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import torch

import benchmarks.methods.networks  # noqa: F401  makes the other networks known
from benchmarks.paper.experiments import Experiment
from benchmarks.paper.runs import config_gmacs
from endosdk.io.whole_files import write_json
from endosdk.jobs.machine import cpu_name
from endosdk.training.devices import channels_last, precision_on
from endosdk.training.loss import build_loss
from endosdk.training.memory import keep_freed_memory
from endosdk.training.networks import build_network
from endosdk.training.networks.base import Window

TIMED_STEPS = 2  # the quicker one counts; a first one warms up


def speeds(
    experiments: list[Experiment], file: Path, device: str, budget: str, overrides: dict[str, Any]
) -> dict[str, float]:
    """1e9 MACs a second by network: measured once for each device, and kept in ``file``.

    The step is that of the network's first experiment: its crops, its loss, backward pass and update, on one pair of
    noise. Other experiments with the same network differ in MACs.
    """
    threads = torch.get_num_threads()
    where = torch.cuda.get_device_name() if device.startswith("cuda") else f"{cpu_name()}, {threads} threads"
    kept: dict[str, dict[str, float]] = json.loads(file.read_text()) if file.exists() else {}
    found = {}
    for experiment in experiments:
        settings = {**experiment.settings(budget, overrides), "batch": 1}
        network = settings["network"]
        key = f"{network} on {where}, crop {settings['crop']}, window {settings.get('refine_crop')}"
        if key not in kept:
            print(f"timing a training step of {network}", file=sys.stderr)
            speed = config_gmacs(settings) / seconds_per_step(settings, device)
            kept[key] = {"gmacs_per_s": float(f"{speed:.3g}"), "load": round(os.getloadavg()[0], 1)}
            write_json(file, kept)
        if network not in found and kept[key]["load"] > threads + 1 and not device.startswith("cuda"):
            load = f"load {kept[key]['load']} on {threads} threads"
            print(f"{network} was timed beside other work ({load}): hours are too long", file=sys.stderr)
        found.setdefault(network, kept[key]["gmacs_per_s"])
    return found


def seconds_per_step(settings: dict[str, Any], device: str) -> float:
    """Time one training step on a batch of noise."""
    if device == "cpu":
        keep_freed_memory()  # as the training loop does
    batch, (height, width) = settings["batch"], settings["crop"]
    network = build_network(settings["network"], settings["max_disparity"]).to(device).train()
    channels_last(network)
    loss = build_loss(settings["loss"], settings["balance"])
    optimiser = torch.optim.RMSprop(network.parameters(), lr=settings["rate"])
    left, right = (255 * torch.rand(batch, 3, height, width).to(device).contiguous(memory_format=torch.channels_last)
                   for _ in range(2))  # fmt: skip
    truth = 1 + settings["max_disparity"] * torch.rand(batch, 1, height, width).to(device) / 2
    part = settings.get("refine_crop")
    window = Window(0, 0, *part) if part else None
    half = precision_on(torch.device(device), settings.get("precision", "auto")) == "bf16"
    times = []
    for _ in range(1 + TIMED_STEPS):
        started = time.perf_counter()
        with torch.autocast(device.partition(":")[0], dtype=torch.bfloat16, enabled=half):
            maps = [found.float() for found in network(left, right, window=window).disparities]
        wanted = [truth] + [window.of(truth) if window else truth] * (len(maps) - 1)
        total = sum(loss(found, true, true > 0) for found, true in zip(maps, wanted, strict=True))
        optimiser.zero_grad()
        total.backward()  # type: ignore[union-attr]
        optimiser.step()
        if device.startswith("cuda"):
            torch.cuda.synchronize()
        times.append(time.perf_counter() - started)
    return min(times[1:])
