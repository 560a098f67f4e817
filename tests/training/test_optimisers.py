"""The optimisers of a run: what Muon does to matrices and to everything else."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import nn

from endosdk.training.config import TrainConfig
from endosdk.training.optimisers import Muon, build_optimiser, orthogonalised


@pytest.mark.parametrize("shape", [(8, 72), (72, 8), (16, 16)])
def test_an_orthogonalised_matrix_keeps_its_directions_and_evens_their_sizes(shape):
    torch.manual_seed(0)
    left, _ = torch.linalg.qr(torch.randn(shape[0], min(shape)))
    right, _ = torch.linalg.qr(torch.randn(shape[1], min(shape)))
    sizes = torch.logspace(0, -2, min(shape))
    found = orthogonalised(left @ torch.diag(sizes) @ right.T)
    core = left.T @ found @ right
    evened = torch.diagonal(core)
    assert evened.min() > 0.6 and evened.max() < 1.3
    torch.testing.assert_close(core, torch.diag(evened), atol=1e-4, rtol=0)


def test_a_step_of_a_convolution_has_the_size_that_the_rate_says():
    torch.manual_seed(0)
    conv = nn.Conv2d(8, 16, 3, bias=False)
    before = conv.weight.detach().clone()
    optimiser = Muon(conv, rate=1e-2, weight_decay=0.0)
    for scale in (1e-6, 1e6):  # how steep the loss is does not count
        conv.weight.data.copy_(before)
        conv.weight.grad = scale * torch.randn_like(before)
        optimiser.step()
        moved = (conv.weight.detach() - before).square().mean().sqrt()
        assert float(moved) == pytest.approx(0.2 * 1e-2, rel=0.2)


def test_what_is_no_matrix_goes_by_adamw():
    torch.manual_seed(0)
    ours = nn.Sequential(nn.Conv2d(4, 1, 3), nn.PReLU())  # a single row, its bias, and a slope
    theirs = copy.deepcopy(ours)
    muon = Muon(ours, rate=1e-2, weight_decay=0.1)
    adamw = torch.optim.AdamW(theirs.parameters(), lr=1e-2, weight_decay=0.1)
    for seed in range(5):
        for network, optimiser in ((ours, muon), (theirs, adamw)):
            optimiser.zero_grad()
            view = torch.randn(2, 4, 8, 8, generator=torch.Generator().manual_seed(seed))
            (network(view) - 1.0).abs().mean().backward()
            optimiser.step()
    for mine, other in zip(ours.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(mine, other, atol=1e-5, rtol=1e-4)


def test_muon_gets_down_a_narrow_valley():
    """Along one direction the loss is a hundred times as steep as along the others."""
    torch.manual_seed(0)
    conv, wanted = nn.Conv2d(8, 8, 1, bias=False), torch.randn(8, 8, 1, 1)
    steep = torch.ones(8, 1, 1, 1)
    steep[0] = 10.0

    def loss():
        return ((conv.weight - wanted) * steep).square().mean()

    optimiser = Muon(conv, rate=0.2, weight_decay=0.0)
    before = loss().item()
    for step in range(300):
        optimiser.param_groups[0]["lr"] = 0.2 * 0.98**step
        optimiser.zero_grad()
        loss().backward()
        optimiser.step()
    assert loss().item() < 0.01 * before


@pytest.mark.parametrize("name, kind", [("rmsprop", torch.optim.RMSprop), ("adamw", torch.optim.AdamW), ("muon", Muon)])
def test_each_name_gives_its_optimiser_with_the_rate_of_the_settings(name, kind):
    built = build_optimiser(nn.Conv2d(3, 4, 3), TrainConfig(optimiser=name, rate=0.25))
    assert type(built) is kind
    assert [group["lr"] for group in built.param_groups] == [0.25]
