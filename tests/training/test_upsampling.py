"""Upsampling in torch: the same as the compiled core's, and what trains through it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from endosdk.training.networks import build_network
from endosdk.training.networks.base import Deployed, Prediction
from endosdk.training.upsampling import joint_bilateral_upsampling, on_input_grid
from tests.core.test_joint_bilateral import scene, upsampled


def log_scale(confidence: np.ndarray) -> torch.Tensor:
    """The logarithm of the scale of the Laplace law that a confidence stands for."""
    return -torch.log(-torch.log1p(-torch.from_numpy(confidence).double())).float()


@pytest.mark.parametrize("size", [(1, 1, 2), (9, 13, 2), (7, 66, 3), (4, 9, 8)])
def test_is_what_the_core_does(size: tuple[int, int, int]) -> None:
    disparity, confidence, view = scene(*size)
    found = joint_bilateral_upsampling(
        torch.from_numpy(disparity)[None, None], log_scale(confidence)[None, None], torch.from_numpy(view)[None].float()
    )
    np.testing.assert_allclose(found[0, 0].numpy(), upsampled(disparity, confidence, view), rtol=5e-6)


def test_gradient_is_the_share_of_each_cell() -> None:
    disparity, confidence, view = scene(5, 6, 2)
    cells = torch.from_numpy(disparity)[None, None].requires_grad_()
    found = joint_bilateral_upsampling(cells, log_scale(confidence)[None, None], torch.from_numpy(view)[None].float())
    found[0, 0, 4, 7].backward()
    assert cells.grad is not None
    # The answer is a mean: shares that are no less than 0 and sum to 1, most of it from cells that lie near.
    share = cells.grad[0, 0]
    assert (share >= 0).all()
    assert share.sum().item() == pytest.approx(1.0, abs=1e-5)
    assert (share * cells[0, 0]).sum().item() == pytest.approx(found[0, 0, 4, 7].item(), rel=1e-5)
    moved = disparity.copy()
    moved[2, 3] += 1.0
    other = joint_bilateral_upsampling(
        torch.from_numpy(moved)[None, None], log_scale(confidence)[None, None], torch.from_numpy(view)[None].float()
    )
    assert (other - found)[0, 0, 4, 7].item() == pytest.approx(share[2, 3].item(), abs=1e-5)


def test_only_the_refined_map_of_a_smaller_grid_is_guided() -> None:
    network = build_network("fast", 48).eval()
    left = torch.rand(1, 3, 64, 96) * 255
    with torch.inference_mode():
        prediction = network(left, left)
        coarse, refined = on_input_grid(network, prediction, left)
        (alone,) = on_input_grid(
            network, Prediction(prediction.disparities[:1], prediction.evidence), left, refined=False
        )
    assert coarse.shape == refined.shape == (1, 1, 64, 96)
    torch.testing.assert_close(coarse, alone)
    bilinear = torch.nn.functional.interpolate(prediction.disparities[-1], scale_factor=2.0, mode="bilinear")
    assert not torch.allclose(refined, bilinear)


def test_a_network_trained_for_a_larger_output_stride_is_seen_as_it_is_deployed() -> None:
    torch.manual_seed(0)
    network = build_network("wang2020", 48).eval()
    torch.nn.init.normal_(network.refinement[-1].weight, std=0.3)
    network.deploy_at(4)
    left, right = torch.randint(0, 256, (2, 1, 3, 64, 96), dtype=torch.uint8)
    with torch.inference_mode():
        cells, confidence = Deployed(network)(left, right)
        coarse, seen = on_input_grid(network, network(left.float(), right.float()), left.float())
    assert cells.shape == (1, 1, 16, 24) and coarse.shape == (1, 1, 64, 96)
    view = np.ascontiguousarray(left[0].numpy())
    np.testing.assert_allclose(seen[0, 0], upsampled(cells[0, 0].numpy(), confidence[0, 0].numpy(), view), rtol=2e-5)


def test_a_network_of_full_size_is_left_as_it_is() -> None:
    network = build_network("wang2020", 24).eval()
    maps = [torch.rand(1, 1, 16, 24) for _ in range(2)]
    found = on_input_grid(network, Prediction(maps, torch.zeros(1, 2, 16, 24)), torch.zeros(1, 3, 16, 24))
    assert all(a is b for a, b in zip(found, maps, strict=True))
