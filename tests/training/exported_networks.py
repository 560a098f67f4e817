"""Both networks and their files, written once for all tests: following a network into a graph takes long."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import torch
from torch import nn

from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks import build_network
from endosdk.training.networks.base import StereoNetwork


class Exported(NamedTuple):
    """A network in evaluation mode, its file, and what that was to say about itself."""

    network: StereoNetwork
    path: Path
    info: ModelDescription


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


def export_into(folder: Path, name: str) -> Exported:
    """Write a network whose weights leave no layer idle."""
    torch.manual_seed(1)
    network = shaken(build_network(name, max_disparity=128 if name == "cascade" else 40))
    with torch.no_grad():
        weights = network.confidence.weights
        weights.copy_(
            torch.tensor([0.3, 0.2, 0.4, 0.1, -0.1, 0.2, 0.1, 0.1, -0.1, 0.1, 0.1, -0.1, 0.1, 0.1])[: len(weights)]
        )
    exported = Exported(network, folder / f"{name}.onnx", ModelDescription(name, "3", training={"recipe": "none"}))
    export_model(network, exported.path, exported.info)
    return exported
