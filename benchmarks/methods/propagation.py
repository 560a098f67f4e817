"""Spatial propagation (Liu et al., NeurIPS 2017) in plain operators: a map flows from left to right, row to row."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch._higher_order_ops.scan import scan

NO_DIVISION_BY_ZERO = 1e-8


class Propagation(nn.Module):
    """h[x] = (1 - g1 - g2 - g3) v[x] + g1 h[x-1, y-1] + g2 h[x-1, y] + g3 h[x-1, y+1], column by column."""

    def forward(self, values: Tensor, gates: Tensor) -> Tensor:
        """Propagate values [N, C, h, w] under gates [N, 3 C, h, w], whose sizes may be anything."""
        three = torch.unflatten(gates, 1, (3, -1))
        # Always to a sum of one, as AnyNet's authors do: beyond it the recurrence would grow along the row.
        three = three / (three.abs().sum(dim=1, keepdim=True) + NO_DIVISION_BY_ZERO)
        columns, weights = values.permute(3, 0, 1, 2), three.permute(4, 1, 0, 2, 3)
        if torch.compiler.is_exporting():  # one operator of the file, for every width
            start = torch.zeros_like(columns[0])
            _, flowed = scan(_kept_step, start, (columns.contiguous(), weights.contiguous()))
            return torch.Tensor.permute(flowed, (1, 2, 3, 0))
        state, states = torch.zeros_like(columns[0]), []
        for value, weight in zip(columns.unbind(0), weights.unbind(0), strict=True):
            state = _step(state, value, weight)
            states.append(state)
        return torch.stack(states, dim=-1)


def _step(before: Tensor, value: Tensor, weight: Tensor) -> Tensor:
    padded = F.pad(before, (1, 1))
    own = (1.0 - weight.sum(dim=0)) * value
    return own + weight[0] * padded[..., :-2] + weight[1] * before + weight[2] * padded[..., 2:]


def _kept_step(before: Tensor, inputs: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    after = _step(before, *inputs)
    return after, after.clone()
