"""What the published networks share, so that the same loop trains, calibrates and exports them as it does ours."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.methods.planes import fold_batch_norms, planes_for_volumes
from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork, Window
from endosdk.training.networks.confidence import ConfidenceHead


class Stages(NamedTuple):
    """All maps of a network, coarse to fine, each [N, 1, H, W] px, and the evidence [N, K, H, W] of the last."""

    maps: list[Tensor]
    evidence: Tensor


class PublishedNetwork(StereoNetwork):
    """A published network whose stages are all supervised at full size.

    In training every map is returned, to be weighted by ``stage_weights``; otherwise the first and the last. Without
    ``refined`` a last stage that starts to learn late is left out; where there is none, nothing changes.
    """

    coarse_stride = output_stride = 1
    refine_margin = 0
    stage_weights: tuple[float, ...]  # of the loss of each map, as published

    def __init__(self) -> None:
        super().__init__()
        self.confidence = ConfidenceHead(channels=2)

    @abstractmethod
    def stages(self, left: Tensor, right: Tensor, late: bool = True) -> Stages:
        """Match float views [N, 3, H, W], 0..255; without ``late`` the stages that learn from the first step alone."""

    def forward(self, left: Tensor, right: Tensor, refined: bool = True, window: Window | None = None) -> Prediction:
        """Predict; without ``refined`` by the stages that learn from the first step, of which the last one answers."""
        if window is not None:
            raise InvalidArgument("refine_crop", f"must be None: {self.name} is trained as a whole", window)
        maps, evidence = self.stages(left, right, late=refined)
        if self.training:
            return Prediction(maps, evidence)
        return Prediction([maps[0], maps[-1]] if refined else maps[-1:], evidence)

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Return the finest map: the network has no part that works on the left view alone."""
        maps, evidence = self.stages(left, right)
        return Coarse(maps[-1], evidence, left)

    def refine(self, coarse: Coarse) -> Prediction:
        """Return the map as it is."""
        return Prediction([coarse.disparity], coarse.evidence)

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode with the same favours that our own networks get in their files."""
        form = copy.deepcopy(self).eval()
        fold_batch_norms(form)
        planes_for_volumes(form)
        return form


def enlarge(values: Tensor, like: Tensor) -> Tensor:
    """Bring a map to the height and width of another, bilinearly."""
    return F.interpolate(values, size=like.shape[-2:], mode="bilinear", align_corners=False)


@contextmanager
def exactly(like: Tensor) -> Iterator[None]:
    """Leave autocast for a while: whatever is computed takes the type of its inputs."""
    kind = like.device.type
    with torch.autocast(kind, enabled=False) if torch.amp.is_autocast_available(kind) else nullcontext():
        yield


def he_normal(network: nn.Module) -> None:
    """Draw all convolutions as both papers do: normal, for rectifiers, by their outputs."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.Conv3d | nn.ConvTranspose2d | nn.ConvTranspose3d):
            nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
            if module.bias is not None:
                nn.init.zeros_(module.bias)


def column_index(like: Tensor) -> Tensor:
    """Return 0, 1, ... along the width of a map, shaped to broadcast."""
    return torch.arange(like.shape[-1], dtype=like.dtype, device=like.device)
