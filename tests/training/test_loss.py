import math

import pytest
import torch

from endosdk.errors import InvalidArgument
from endosdk.training.loss import (
    build_loss,
    l1_loss,
    l2_loss,
    scale_invariant_loss,
    smooth_l1_loss,
    volume_cross_entropy,
)

LOSSES = ["scale-invariant", "l1", "l2", "smooth-l1"]


def maps(*values):
    return torch.tensor(values, dtype=torch.float64).reshape(1, 1, 1, -1)


def everywhere(values):
    return torch.ones_like(values, dtype=torch.bool)


@pytest.mark.parametrize("name", LOSSES)
def test_gradient_is_that_of_finite_differences(name):
    generator = torch.Generator().manual_seed(1)
    predicted = torch.rand((2, 1, 3, 4), generator=generator, dtype=torch.float64) * 20 + 1
    truth = torch.rand((2, 1, 3, 4), generator=generator, dtype=torch.float64) * 20 + 1
    mask = torch.rand((2, 1, 3, 4), generator=generator) > 0.3
    loss = build_loss(name)
    assert torch.autograd.gradcheck(lambda p: loss(p, truth, mask), predicted.requires_grad_())


def test_scale_invariant_loss_by_hand():
    predicted, truth = maps(2.0, 8.0), maps(1.0, 2.0)
    a, b = math.log(2), math.log(4)
    expected = (a * a + b * b) / 2 - 0.5 * (a + b) ** 2 / 4
    assert scale_invariant_loss(predicted, truth, everywhere(truth)).item() == pytest.approx(expected)


def test_l1_l2_and_smooth_l1_by_hand():
    predicted, truth = maps(1.0, 5.0), maps(1.5, 2.0)
    assert l1_loss(predicted, truth, everywhere(truth)).item() == pytest.approx((0.5 + 3.0) / 2)
    assert l2_loss(predicted, truth, everywhere(truth)).item() == pytest.approx((0.25 + 9.0) / 2)
    assert smooth_l1_loss(predicted, truth, everywhere(truth)).item() == pytest.approx((0.125 + 2.5) / 2)


def test_full_balance_ignores_a_common_factor_and_none_does_not():
    truth = maps(3.0, 7.0, 20.0)
    predicted = maps(4.0, 6.0, 25.0)
    mask = everywhere(truth)
    for balance, same in ((1.0, True), (0.5, False), (0.0, False)):
        once, thrice = (scale_invariant_loss(predicted * k, truth, mask, balance).item() for k in (1.0, 3.0))
        assert (once == pytest.approx(thrice)) is same


def test_no_balance_is_the_square_in_log_space():
    truth, predicted = maps(3.0, 7.0), maps(4.0, 6.0)
    expected = l2_loss(predicted.log(), truth.log(), everywhere(truth)).item()
    assert scale_invariant_loss(predicted, truth, everywhere(truth), 0.0).item() == pytest.approx(expected)


@pytest.mark.parametrize("name", LOSSES)
def test_without_truth_the_loss_and_its_gradient_are_zero(name):
    predicted = maps(1.0, 2.0).requires_grad_()
    loss = build_loss(name)(predicted, maps(math.nan, math.nan), torch.zeros(1, 1, 1, 2, dtype=torch.bool))
    loss.backward()
    assert loss.item() == 0.0
    assert torch.equal(predicted.grad, torch.zeros_like(predicted))


@pytest.mark.parametrize("name", LOSSES)
def test_unknown_truth_and_pairs_without_truth_do_not_count(name):
    loss = build_loss(name)
    alone = loss(maps(4.0, 9.0), maps(5.0, 8.0), torch.tensor([True, True]).reshape(1, 1, 1, 2))
    predicted = torch.cat([maps(4.0, 9.0, 3.0), maps(1.0, 1.0, 1.0)]).requires_grad_()
    truth = torch.cat([maps(5.0, 8.0, math.nan), maps(math.nan, math.nan, math.nan)])
    joined = loss(predicted, truth, torch.isfinite(truth))
    joined.backward()
    assert joined.item() == pytest.approx(alone.item())
    assert torch.isfinite(predicted.grad).all()
    assert torch.count_nonzero(predicted.grad[1]) == 0


def test_a_prediction_of_zero_keeps_the_logarithm_finite():
    predicted = maps(0.0, 5.0).requires_grad_()
    loss = scale_invariant_loss(predicted, maps(4.0, 5.0), everywhere(predicted))
    loss.backward()
    assert math.isfinite(loss.item())
    assert torch.isfinite(predicted.grad).all()


def test_unknown_loss_names_the_choices():
    with pytest.raises(InvalidArgument, match="smooth-l1"):
        build_loss("l3")


CANDIDATES = torch.tensor([0.0, 4.0, 8.0, 16.0, 24.0])


def cost_of(truths):
    """The cost [5, N] whose distribution is that of the truths: its width is half of the gap they lie in."""
    scales = torch.tensor([2.0 if truth <= 8.0 else 4.0 for truth in truths])
    return (truths - CANDIDATES.view(5, 1)).abs() / scales


def volume_of(truth):
    """The cost [1, 5, 4, 1, 1] whose distribution is the truth's own, for a truth [8, 8] with one value a cell."""
    return cost_of(truth[::4, ::4].reshape(4)).view(1, 5, 4, 1, 1)


def test_a_volume_that_tells_the_truth_has_no_loss():
    truth = torch.tensor([[2.0, 6.0], [11.0, 24.0]]).repeat_interleave(4, 0).repeat_interleave(4, 1)
    cost, truth = volume_of(truth), truth.view(1, 1, 8, 8)
    assert volume_cross_entropy(cost, truth, everywhere(truth), CANDIDATES).item() == pytest.approx(0.0, abs=1e-5)
    assert volume_cross_entropy(cost.flip(2), truth, everywhere(truth), CANDIDATES).item() > 0.5


def test_a_cell_across_an_edge_wants_two_peaks():
    truth = torch.full((1, 1, 8, 8), 4.0)
    truth[..., 2::4] = truth[..., 3::4] = 24.0
    peaks = torch.softmax(-cost_of(torch.tensor([4.0, 24.0])), dim=0)
    both, between = -torch.log(peaks.mean(dim=1)), cost_of(torch.tensor([14.0]))
    losses = [
        volume_cross_entropy(cost.view(1, 5, 1, 1, 1).expand(1, 5, 4, 1, 1), truth, everywhere(truth), CANDIDATES)
        for cost in (both, between)
    ]
    assert losses[0].item() == pytest.approx(0.0, abs=1e-5)
    assert losses[1].item() > 1.0


def test_cells_without_truth_do_not_count():
    truth = torch.full((1, 1, 8, 8), 4.0)
    cost = volume_of(truth[0, 0])
    cost[0, :, 3] = CANDIDATES.flip(0).view(5, 1, 1)  # far from right in the last cell
    mask = everywhere(truth)
    assert volume_cross_entropy(cost, truth, mask, CANDIDATES).item() > 0.5
    mask = mask.clone()
    mask[..., 4:, 4:] = False
    truth[..., 4:, 4:] = float("nan")
    assert volume_cross_entropy(cost, truth, mask, CANDIDATES).item() == pytest.approx(0.0, abs=1e-5)
    assert volume_cross_entropy(cost, truth, torch.zeros_like(mask), CANDIDATES).item() == 0.0
