"""The networks by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.networks.cascade import Cascade
from endosdk.training.networks.fast import Fast
from endosdk.training.networks.wang2020 import Wang2020

SEARCHING = ("cascade", "fast")  # networks that have settings of their search

__all__ = ["NETWORKS", "StereoNetwork", "build_network"]

NETWORKS: dict[str, Callable[..., StereoNetwork]] = {
    "cascade": Cascade,
    "fast": Fast,
    "wang2020": Wang2020,
    "wang2020-photometric": partial(Wang2020, photometric=True),
}


def build_network(
    name: str,
    max_disparity: int = 72,
    *,
    output_stride: int | None = None,
    inference_width: int | None = None,
    **search: int | None,
) -> StereoNetwork:
    """Build the named network with random weights.

    ``max_disparity`` in px at the input width; ``output_stride`` as in `StereoNetwork.deploy_at`;
    ``inference_width`` in px, at which frames are to be seen, by default the one that the network is made for;
    ``search`` are the settings of its search, ``dense_disparity`` and ``mode_reach`` of `Fast` and `Cascade`. Raises
    InvalidArgument for a setting that the network does not have.
    """
    if name not in NETWORKS:
        raise InvalidArgument("network", f"must be one of {', '.join(sorted(NETWORKS))}", name)
    chosen = {key: value for key, value in search.items() if value is not None}
    if chosen and name not in SEARCHING:
        raise InvalidArgument(next(iter(chosen)), f"is a setting of the networks {' and '.join(SEARCHING)}", name)
    network = NETWORKS[name](max_disparity=max_disparity, **chosen)
    network.deploy_at(output_stride)
    if inference_width is not None:
        network.inference_width = inference_width
    return network
