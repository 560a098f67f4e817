"""The parts that turn two feature maps into disparity: difference volume, 3-D aggregation, soft-argmin."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
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


def without_autocast(of: Tensor) -> AbstractContextManager[object]:
    """Compute as the tensors are, where they lie, within autocast too."""
    kind = of.device.type
    return torch.autocast(kind, enabled=False) if torch.amp.is_autocast_available(kind) else nullcontext()


class Aggregation(nn.Module):
    """3x3x3 convolutions over the volume of differences; the last gives the cost."""

    def __init__(self, channels: int, planes: int, layers: int, slope: float) -> None:
        super().__init__()
        self.planes = planes
        self.layers = nn.ModuleList(ConvNorm(channels, channels, dims=3, slope=slope) for _ in range(layers))
        self.cost = nn.Conv3d(channels, 1, 3, padding=1)

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Map features of both views [N, C, h, w] to cost [N, h, w, D]: disparity last, so that softmax is quick."""
        if self.planes == 2:
            # In bf16 the gradients of a convolution over two planes are random numbers in torch 2.
            with without_autocast(left):
                return self._cost(*(view.to(torch.promote_types(view.dtype, torch.float32)) for view in (left, right)))
        return self._cost(left, right)

    def _cost(self, left: Tensor, right: Tensor) -> Tensor:
        volume = torch.stack(difference_planes(left, right, self.planes), dim=2)
        # In this layout the gradient of the weights takes processors half the time.
        volume = volume.contiguous(memory_format=torch.channels_last_3d)
        for layer in self.layers:
            volume = layer(volume)
        cost: Tensor = self.cost(volume)
        return cost.squeeze(1).permute(0, 2, 3, 1)


@dataclass(frozen=True)
class Planes:
    """Candidate disparities, in cells of the matching grid: first every cell, from ``dense`` on every second one.

    Depth is known as well with fewer planes where surfaces are near: a cell there is a small part of the disparity.
    """

    dense: int
    sparse: int = 0

    def __len__(self) -> int:
        return self.dense + self.sparse

    @property
    def shifts(self) -> tuple[int, ...]:
        """The candidates, from far to near."""
        return (*range(self.dense), *range(self.dense, self.dense + 2 * self.sparse, 2))

    def gap_variance(self, mean: Tensor) -> Tensor:
        """Return the variance of a distribution over the two planes around ``mean``, in cells, whose mean it is."""
        gap = torch.where(mean < self.dense, 1.0, 2.0) if self.sparse else torch.ones_like(mean)
        place = (mean - self.dense) / gap
        fraction = place - place.floor()
        return fraction * (1.0 - fraction) * gap * gap


class SoftArgmin(NamedTuple):
    """Mean of the disparity distribution and its spread beyond what lies between two planes, in cells."""

    disparity: Tensor  # [N, 1, h, w]
    excess: Tensor  # [N, 1, h, w], variance, >= 0


def soft_argmin(cost: Tensor, planes: Planes | None = None, reach: int | None = None) -> SoftArgmin:
    """Reduce cost [N, h, w, D] to the mean candidate under softmax(-cost), and the excess variance.

    ``planes`` are the D candidates, by default 0..D-1. With ``reach`` the mean is that of the likeliest candidate and
    so many on either side of it: of a distribution with two peaks, the answer is one of them and nothing in between.

    A distribution that says "exactly here" still has the variance f(1 - f) when the answer lies the fraction f
    between two planes. Only what exceeds that is doubt.

    At least float32 is used, within autocast too: the mean of planes 8 px apart, in the eight digits of bf16, would be
    a disparity in steps of a quarter of a pixel.
    """
    cost = cost.to(torch.promote_types(cost.dtype, torch.float32))
    planes = planes or Planes(cost.shape[-1])
    with without_autocast(cost):
        value = torch.tensor(planes.shifts, dtype=cost.dtype, device=cost.device)
        weights = torch.softmax(-cost, dim=-1)
        moments = weights @ torch.stack([value, value * value], dim=1)
        mean, square = moments[..., :1], moments[..., 1:]
        doubt = square.detach() - mean.detach() ** 2 - planes.gap_variance(mean.detach())
        if reach is not None:
            index = torch.arange(len(planes), device=cost.device)
            near = (index - cost.detach().argmin(dim=-1, keepdim=True)).abs() <= reach
            weights = weights * near
            mean = (weights @ value[:, None]) / weights.sum(dim=-1, keepdim=True)
    return SoftArgmin(*(part.squeeze(-1).unsqueeze(1) for part in (mean, doubt.clamp_min(0.0))))


def soft_argmin_of_planes(cost: Tensor, planes: Planes, order: Sequence[int], reach: int | None = None) -> SoftArgmin:
    """Do the same for cost [N, D, M] of the planes in this ``order``, with less for runtimes to move; [N, 1, M]."""
    value = torch.tensor(planes.shifts)[list(order)].to(cost)
    weights = torch.exp(cost.amin(dim=1, keepdim=True) - cost)
    moments = torch.stack([torch.ones_like(value), value, value * value]) @ weights
    total, first, second = torch.split(moments, 1, dim=1)
    mean = first / total
    excess = second / total - mean**2 - planes.gap_variance(mean)
    if reach is not None:
        index = torch.tensor(order).to(cost)
        likeliest = index[cost.argmin(dim=1, keepdim=True)]
        near = torch.where((index[:, None] - likeliest).abs() <= reach, weights, 0.0)
        total, first = torch.split(torch.stack([torch.ones_like(value), value]) @ near, 1, dim=1)
        mean = first / total
    return SoftArgmin(mean, excess.clamp_min(0.0))


def match_evidence(found: SoftArgmin, cell: int) -> Tensor:
    """Logarithms [N, 2, h, w] of what betrays a bad match: doubt of the distribution, and an edge nearby.

    The edge is the largest minus the smallest disparity among 3x3 neighbours; ``cell`` is the plane distance in px.
    """
    disparity = found.disparity.detach() * cell
    edge = F.max_pool2d(disparity, 3, 1, 1) + F.max_pool2d(-disparity, 3, 1, 1)
    return torch.cat([torch.log(found.excess + 1e-3), torch.log(edge + 0.1)], dim=1)
