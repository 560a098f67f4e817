"""Both networks and their files, each written once for all tests: following a network into a graph takes long."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.metadata
import shutil
from functools import cached_property
from pathlib import Path

import torch
from torch import nn

from endosdk import _core
from endosdk.io.file_hash import file_sha256
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks import build_network
from endosdk.training.networks.base import StereoNetwork
from tests.conftest import ROOT


def shaken(network: StereoNetwork) -> StereoNetwork:
    """Give every weight and statistic a value, as training would, the refinement's zeros too."""
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for module in network.modules():
            if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
                module.running_mean.normal_(0.0, 0.2, generator=generator)
                module.running_var.uniform_(0.5, 1.5, generator=generator)
                module.weight.uniform_(0.7, 1.3, generator=generator)
                module.bias.normal_(0.0, 0.2, generator=generator)
        last = network.refinement[-1] if isinstance(network.refinement, nn.Sequential) else network.refinement.last
        last.weight.normal_(0.0, 0.05, generator=generator)
    return network.eval()


class Exported:
    """A network in evaluation mode whose weights leave no layer idle, what its file says, and the file."""

    def __init__(self, folder: Path, name: str) -> None:
        torch.manual_seed(1)
        self.network = shaken(build_network(name, max_disparity=128 if name == "cascade" else 40))
        with torch.no_grad():
            weights = self.network.confidence.weights
            weights.copy_(
                torch.tensor([0.3, 0.2, 0.4, 0.1, -0.1, 0.2, 0.1, 0.1, -0.1, 0.1, 0.1, -0.1, 0.1, 0.1])[: len(weights)]
            )
        self.info = ModelDescription(name, "3", training={"recipe": "none"})
        self._file = folder / f"{name}.onnx"

    @cached_property
    def path(self) -> Path:
        """Where the file is: it is written when it is first asked for, by one of the processes that test."""
        with self._file.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not self._file.exists():
                export_model(self.network, self._file, self.info)
                if sources() != SOURCES:  # they were edited meanwhile: nobody knows which ones this file is of
                    self._file.unlink()
                    raise RuntimeError("the sources have changed since the tests began: run them again")
        return self._file


def sources() -> str:
    """Return the hash of what decides what a file holds: the modules that write it, compiled ones and libraries too."""
    files = [*(ROOT / "python" / "endosdk" / "training").rglob("*.py"), Path(_core.__file__), Path(__file__)]
    said = [file_sha256(file) for file in sorted(files)]
    said += [importlib.metadata.version(name) for name in ("torch", "onnx", "onnxscript", "numpy")]
    return hashlib.sha256("".join(said).encode()).hexdigest()


SOURCES = sources()  # as they are when they are imported


def shared_folder() -> Path:
    """Return a folder that all tests of these sources have in common, of this run or a later one."""
    folder = ROOT / "build" / "exported-networks" / SOURCES[:16]
    folder.mkdir(parents=True, exist_ok=True)
    for older in folder.parent.iterdir():
        if older != folder:
            shutil.rmtree(older, ignore_errors=True)
    return folder
