"""The parts that turn two feature maps into disparity: difference volume, 3-D aggregation, soft-argmin."""

from __future__ import annotations

from contextlib import nullcontext
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.blocks import ConvNorm


def difference_planes(left: Tensor, right: Tensor, planes: int) -> list[Tensor]:
    """Subtract from the left features the right ones shifted by 0..planes-1 cells: each [N, C, h, w].

    Where a shift leaves the right view its features count as zero.
    """
    width = right.shape[-1]
    padded = F.pad(right, (planes - 1, 0))
    return [left - padded[..., planes - 1 - plane : planes - 1 - plane + width] for plane in range(planes)]


class Aggregation(nn.Module):
    """3x3x3 convolutions over the volume of differences; the last gives the cost."""

    def __init__(self, channels: int, planes: int, layers: int, slope: float) -> None:
        super().__init__()
        self.planes = planes
        self.layers = nn.ModuleList(ConvNorm(channels, channels, dims=3, slope=slope) for _ in range(layers))
        self.cost = nn.Conv3d(channels, 1, 3, padding=1)

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Map features of both views [N, C, h, w] to cost [N, h, w, D]: disparity last, so that softmax is quick."""
        volume = torch.stack(difference_planes(left, right, self.planes), dim=2)
        # In this layout the gradient of the weights takes processors half the time.
        volume = volume.contiguous(memory_format=torch.channels_last_3d)
        for layer in self.layers:
            volume = layer(volume)
        cost: Tensor = self.cost(volume)
        return cost.squeeze(1).permute(0, 2, 3, 1)


class SoftArgmin(NamedTuple):
    """Mean of the disparity distribution and its spread beyond what lies between two planes, in planes."""

    disparity: Tensor  # [N, 1, h, w]
    excess: Tensor  # [N, 1, h, w], variance, >= 0


def soft_argmin(cost: Tensor) -> SoftArgmin:
    """Reduce cost [N, h, w, D] to the mean plane under softmax(-cost), and the excess variance.

    A distribution that says "exactly here" still has the variance f(1 - f) when the answer lies the fraction f
    between two planes. Only what exceeds that is doubt.

    At least float32 is used, within autocast too: the mean of planes 8 px apart, in the eight digits of bf16, would be
    a disparity in steps of a quarter of a pixel.
    """
    cost = cost.to(torch.promote_types(cost.dtype, torch.float32))
    kind = cost.device.type
    with torch.autocast(kind, enabled=False) if torch.amp.is_autocast_available(kind) else nullcontext():
        index = torch.arange(cost.shape[-1], dtype=cost.dtype, device=cost.device)
        moments = torch.softmax(-cost, dim=-1) @ torch.stack([index, index * index], dim=1)
    return _of_moments(moments[..., 0].unsqueeze(1), moments[..., 1].unsqueeze(1))


def soft_argmin_of_planes(cost: Tensor, plane: Tensor) -> SoftArgmin:
    """Do the same for cost [N, D, M] of the planes ``plane`` [D], which runtimes do with less to move; [N, 1, M]."""
    weights = torch.exp(cost.amin(dim=1, keepdim=True) - cost)
    moments = torch.stack([torch.ones_like(plane), plane, plane * plane]) @ weights
    total, first, second = torch.split(moments, 1, dim=1)
    return _of_moments(first / total, second / total)


def _of_moments(mean: Tensor, square: Tensor) -> SoftArgmin:
    fraction = mean.detach() - mean.detach().floor()
    excess = square.detach() - mean.detach() ** 2 - fraction * (1.0 - fraction)
    return SoftArgmin(mean, excess.clamp_min(0.0))


def match_evidence(found: SoftArgmin, cell: int) -> Tensor:
    """Logarithms [N, 2, h, w] of what betrays a bad match: doubt of the distribution, and an edge nearby.

    The edge is the largest minus the smallest disparity among 3x3 neighbours; ``cell`` is the plane distance in px.
    """
    disparity = found.disparity.detach() * cell
    edge = F.max_pool2d(disparity, 3, 1, 1) + F.max_pool2d(-disparity, 3, 1, 1)
    return torch.cat([torch.log(found.excess + 1e-3), torch.log(edge + 0.1)], dim=1)
