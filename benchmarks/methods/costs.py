"""What a network costs: parameters, and multiplications with additions (MACs) of a frame or of a training step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from endosdk.training.frame_size import seen_size
from endosdk.training.networks import build_network
from endosdk.training.networks.base import Window

# Backward takes two products (by the input, by the weight) where forward takes one.
BACKWARD_FACTOR = 3


@dataclass(frozen=True)
class NetworkCosts:
    """Costs of one network."""

    params: int
    gmacs: float  # of one frame, all stages, 1e9 MACs


def count_parameters(network: nn.Module) -> int:
    """Numbers that training adjusts."""
    return sum(parameter.numel() for parameter in network.parameters())


def count_macs(
    name: str,
    max_disparity: int,
    height: int,
    width: int,
    *,
    window: tuple[int, int] | None = None,
    refined: bool = True,
    search: dict[str, Any] | None = None,
) -> int:
    """MACs of convolutions and matrix products for one pair, counted on shapes alone: nothing is computed.

    Height and width are padded to the network's multiple, as they are at run time. As in training, ``window`` (height,
    width) limits the refinement, and without ``refined`` there is none. ``search`` as in `network_costs`.
    """
    with torch.device("meta"):
        network = build_network(name, max_disparity, **(search or {})).eval()
        multiple = network.input_multiple
        size = 1, 3, height + -height % multiple, width + -width % multiple
        part = _in_the_middle(window, size[2:], multiple) if window else None
        with FlopCounterMode(display=False) as counter, torch.no_grad():
            network(torch.zeros(size), torch.zeros(size), refined=refined, window=part)
    return int(counter.get_total_flops()) // 2


def _in_the_middle(window: tuple[int, int], size: tuple[int, int], multiple: int) -> Window:
    top, left = ((whole - part) // 2 // multiple * multiple for whole, part in zip(size, window, strict=True))
    return Window(top, left, *window)


def network_costs(name: str, max_disparity: int, height: int, width: int, **search: Any) -> NetworkCosts:
    """Count one network for frames of this size, which a network with a usual width sees reduced.

    ``search`` are further settings of the network, such as ``dense_disparity``.
    """
    with torch.device("meta"):
        network = build_network(name, max_disparity, **search)
    seen = seen_size(width, height, network.inference_width)[::-1]
    return NetworkCosts(count_parameters(network), count_macs(name, max_disparity, *seen, search=search) / 1e9)


def step_gmacs(name: str, max_disparity: int, crop: tuple[int, int], batch: int, **part: Any) -> float:
    """1e9 MACs of one training step on ``batch`` crops (height, width); ``part`` goes to `count_macs`."""
    return BACKWARD_FACTOR * batch * count_macs(name, max_disparity, *crop, **part) / 1e9
