"""Checkpoints: one safetensors file with weights and optimiser state, the settings as JSON in its header."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as safetensors_bytes
from torch import Tensor, nn
from torch.optim import Optimizer

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import parse_json
from endosdk.io.whole_files import whole_file
from endosdk.runtime.models import shipped_weights
from endosdk.training.config import INHERITED, TrainConfig
from endosdk.training.networks import StereoNetwork, build_network
from endosdk.training.past_runs import steps_of

LAST = "last.safetensors"
DONE = 2 / 3  # a run that starts from the weights of a recipe has the rates after this share of its steps
FORMAT = "1"


@dataclass(frozen=True)
class Checkpoint:
    """Everything that a run needs to go on, or an export to begin."""

    config: TrainConfig
    step: int  # steps done by this run alone: none where it only fitted the confidence
    state: dict[str, Any]  # free notes of the run: seconds spent, validations, data set
    network: dict[str, Tensor]
    optimiser: dict[str, Tensor]

    @property
    def steps_in_all(self) -> int:
        """Steps behind these weights: of this run, and of every run that it goes back to."""
        return self.step + steps_of(self.state["init"])

    def build(self) -> StereoNetwork:
        """Build the network that was saved, in evaluation mode."""
        network = configured_network(self.config)
        self.load_into(network)
        return network.eval()

    def load_into(self, network: StereoNetwork) -> None:
        """Give a network these weights. Raises InvalidArgument when they are those of another shape or release."""
        differing = self.differing(network)
        if differing:
            rule = f"must hold the weights of {self.config.network} as this release builds it"
            raise InvalidArgument("checkpoint", rule, f"{len(differing)} that differ, such as {differing[0]}")
        network.load_state_dict(self._adapted(network))

    def differing(self, network: StereoNetwork) -> list[str]:
        """Name the weights that only this or only the network has, or that differ in shape."""
        found, wanted = (
            {name: tensor.shape for name, tensor in tensors.items()}
            for tensors in (self._adapted(network), network.state_dict())
        )
        return sorted(name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name))

    def _adapted(self, network: StereoNetwork) -> dict[str, Tensor]:
        return network.adapted(self.network, self.config.max_disparity, self.config.dense_disparity)


def configured_network(config: TrainConfig) -> StereoNetwork:
    """Build the network that a run is about, with random weights."""
    return build_network(
        config.network,
        config.max_disparity,
        output_stride=config.output_stride,
        inference_width=config.inference_width,
        dense_disparity=config.dense_disparity,
        mode_reach=config.mode_reach,
    )


def save(
    path: Path, config: TrainConfig, step: int, state: dict[str, Any], network: nn.Module, optimiser: Optimizer
) -> None:
    """Write a checkpoint so that a reader finds the old one or the new one, never half."""
    moments = {
        f"{index}.{name}": torch.as_tensor(value)
        for index, entries in optimiser.state_dict()["state"].items()
        for name, value in entries.items()
    }
    _write(path, Checkpoint(config, step, state, network.state_dict(), moments))


def save_weights(path: Path, trained: Checkpoint) -> None:
    """Write what another run needs to start from these weights: all but the state of the optimiser."""
    # Where the data lay and what the run itself started from are of no use elsewhere; the notes say what they were.
    config = replace(trained.config, data=(), init_from=None)
    state = {**trained.state, "history": []}
    _write(path, Checkpoint(config, trained.step, state, trained.network, {}))


def _write(path: Path, content: Checkpoint) -> None:
    config, step, state = content.config, content.step, content.state
    tensors = {f"network.{name}": tensor for name, tensor in content.network.items()}
    tensors.update({f"optimiser.{name}": tensor for name, tensor in content.optimiser.items()})
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    header = {"format": FORMAT, "config": json.dumps(config.as_dict()), "step": str(step), "state": json.dumps(state)}
    with whole_file(path, "out") as stream:
        stream.write(safetensors_bytes(tensors, metadata=header))


def starting_point(source: str, argument: str = "init_from") -> Path:
    """Return the file or run folder that ``source`` names: shipped weights by name, else a path that is there.

    Raises InvalidArgument, which names this ``argument``.
    """
    path = shipped_weights().get(source, Path(source))
    if not path.exists():
        names = ", ".join(shipped_weights())
        raise InvalidArgument(argument, f"must be a run folder, a checkpoint or one of {names}", source)
    return path


def inherited(source: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the settings that a run from the weights ``source`` takes over, without those that are ``given``.

    They are the recipe that made the weights (`INHERITED`), at the rates of its last third: they have learned, and
    higher rates would undo some of it. A run without steps has taken these over already. A crop comes along where
    frames are seen at the same width.
    """
    past = load(starting_point(source)).config
    plain = past.as_dict()
    settings = {name: plain[name] for name in INHERITED if name not in given}
    if any(given.get(name, plain[name]) != plain[name] for name in ("network", "inference_width")):
        settings.pop("crop", None)
    if "rate" not in given:
        settings["rate"] = past.rate_after(DONE) if past.steps else past.rate
    if "final_rate" not in given:
        settings["final_rate"] = min(past.final_rate, given.get("rate", past.final_rate))
    return settings


def load(path: Path) -> Checkpoint:
    """Read a checkpoint file, or the last one of a run folder."""
    file = path / LAST if path.is_dir() else path
    try:
        with safe_open(file, framework="pt") as archive:
            header = archive.metadata() or {}
            tensors = {name: archive.get_tensor(name) for name in archive.keys()}
    except (OSError, SafetensorError) as error:
        raise InvalidArgument("checkpoint", "must be a readable safetensors file", f"{file} ({error})") from error
    if header.get("format") != FORMAT:
        raise InvalidArgument("checkpoint", f"must be one of this package, format {FORMAT}", file)
    try:
        parts: dict[str, dict[str, Tensor]] = {"network": {}, "optimiser": {}}
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            parts[part][rest] = tensor
        config = TrainConfig.from_dict(_settings(parse_json(header["config"])))
        step, state = int(header["step"]), dict(parse_json(header["state"]))
    except InvalidArgument:
        raise
    except (Refused, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise InvalidArgument(
            "checkpoint", "must have a header as this package writes it", f"{file} ({error})"
        ) from error
    return Checkpoint(config, step, state, parts["network"], parts["optimiser"])


def _settings(stored: dict[str, Any]) -> dict[str, Any]:
    """Bring settings of an older checkpoint, which counted cells of the network's own map, to an output stride."""
    cells = stored.pop("answer_cell", 1)
    if cells != 1:
        stored["output_stride"] = cells * build_network(stored["network"], stored["max_disparity"]).output_stride
    return stored


def restore_optimiser(optimiser: Optimizer, tensors: dict[str, Tensor]) -> None:
    """Give the optimiser its saved moments; its rates stay as they are."""
    entries: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        index, _, key = name.partition(".")
        entries.setdefault(int(index), {})[key] = tensor
    optimiser.load_state_dict({"state": entries, "param_groups": optimiser.state_dict()["param_groups"]})
