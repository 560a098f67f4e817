"""The networks by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.networks.fast import Fast, Shape
from endosdk.training.networks.wang2020 import Wang2020

__all__ = ["NETWORKS", "StereoNetwork", "build_network"]

# The variants of fast are for the front of latency and error; none that is shipped has been trained from them.
NETWORKS: dict[str, Callable[..., StereoNetwork]] = {
    "fast": Fast,
    "fast-small": partial(Fast, shape=Shape(blocks=1, layers=1, refine_layers=1, wide_layers=0)),
    "fast-deep": partial(Fast, shape=Shape(layers=4, wide_layers=0)),
    "fast-wide": partial(Fast, shape=Shape(stem=48, volume=32, refine=48, wide_layers=0)),
    "wang2020": Wang2020,
    "wang2020-photometric": partial(Wang2020, photometric=True),
}


def build_network(
    name: str, max_disparity: int = 72, *, answer_cell: int = 1, inference_width: int | None = None
) -> StereoNetwork:
    """Build the named network with random weights.

    ``max_disparity`` in px at the input width; ``answer_cell`` as in `StereoNetwork.answer_in_cells`;
    ``inference_width`` in px, at which frames are to be seen, by default the one that the network is made for.
    """
    if name not in NETWORKS:
        raise InvalidArgument("network", f"must be one of {', '.join(sorted(NETWORKS))}", name)
    network = NETWORKS[name](max_disparity=max_disparity)
    network.answer_in_cells(answer_cell)
    if inference_width is not None:
        network.inference_width = inference_width
    return network
