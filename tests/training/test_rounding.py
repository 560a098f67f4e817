import copy
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest
import torch

from endosdk.datasets.dataset import read_sample
from endosdk.runtime.models import read_model
from endosdk.training import checkpoint
from endosdk.training.frame_size import seen_size, seen_views
from endosdk.training.integer_steps import LEAST_CHANNELS, convolution_steps
from endosdk.training.networks.blocks import EXACT, ConvNorm
from endosdk.training.rounding import Bytes, round_to_bytes, rounded_weights

ROOT = Path(__file__).resolve().parents[2]


def test_weights_are_whole_steps_and_batch_norm_changes_none():
    weights = torch.randn(16, 32, 3, 3, generator=torch.Generator().manual_seed(1))
    steps = torch.from_numpy(convolution_steps(weights.numpy())).view(-1, 1, 1, 1)
    whole = rounded_weights(weights) / steps
    assert (whole - whole.round()).abs().max() < 1e-4
    assert (whole - weights / steps).abs().max() <= 0.5001
    rows = torch.linspace(0.1, 7.0, 16).view(-1, 1, 1, 1)
    np.testing.assert_allclose(rounded_weights(weights * rows), rounded_weights(weights) * rows, rtol=1e-4, atol=1e-6)


def test_activations_have_256_levels_and_pass_the_gradient_within_them():
    numbers = Bytes()
    x = torch.linspace(-1.0, 3.0, 4001).view(1, -1)
    numbers.value("out", x)  # the range is that of the first batch
    inside = x.clone().requires_grad_()
    rounded = numbers.value("out", inside)
    assert len(torch.unique(rounded)) == 256
    assert 0.0 in rounded
    assert (rounded - x).abs().max() <= 0.5001 * 4 / 255
    rounded.sum().backward()
    assert (inside.grad == 1).float().mean() > 0.99
    beyond = torch.tensor([[-50.0, 50.0]], requires_grad=True)
    held = numbers.value("out", beyond)
    held.sum().backward()
    assert held.abs().max() < 6.0  # the range has moved a little, to what was seen just now
    assert (beyond.grad == 0).all()


def test_each_activation_has_a_range_of_its_own():
    numbers = Bytes()
    small, large = torch.rand(1, 100), 100 * torch.rand(1, 100)
    numbers.value("out", large)
    assert (numbers.value("product", small) - small).abs().max() < 0.01


def test_only_blocks_that_are_deployed_in_8_bits_round(exported):
    network = copy.deepcopy(exported["fast"].network)
    round_to_bytes(network)
    blocks = [module for module in network.modules() if isinstance(module, ConvNorm)]
    assert all((block.numbers is EXACT) == (block.conv.out_channels < LEAST_CHANNELS) for block in blocks)
    assert network.state_dict().keys() == exported["fast"].network.state_dict().keys()


def test_rounding_moves_answers_as_far_as_8_bits_do():
    """Of the shipped weights. Which way single values are rounded differs; how much that moves does not."""
    files = sorted((ROOT / "datasets/endosim-gi-cycles/test").iterdir())[::20]
    exact = checkpoint.load(checkpoint.starting_point("fast")).build().eval()
    rounded = copy.deepcopy(exact)
    round_to_bytes(rounded)
    session = ort.InferenceSession(read_model("fast").data, providers=["CPUExecutionProvider"])
    moved = {"training": [], "deployed": []}
    for folder in files:
        sample = read_sample(folder)
        height, width = sample.left.shape[:2]
        size = seen_size(width, height, exact.inference_width)
        views = [view[None] for view in seen_views(sample.left, sample.right, size, exact.input_multiple)]
        deployed = session.run(["disparity"], dict(zip(("left", "right"), views, strict=True)))[0]
        with torch.no_grad():
            answer, training = (
                one(*(torch.from_numpy(view).float() for view in views)).disparities[-1].numpy()
                for one in (exact, rounded)
            )
        moved["training"].append(np.abs(training - answer).mean())
        moved["deployed"].append(np.abs(deployed - answer).mean())
    assert 0.02 < np.mean(moved["deployed"]) < 0.1
    assert 0.6 < np.mean(moved["training"]) / np.mean(moved["deployed"]) < 1.4, moved


@pytest.mark.parametrize("kind", ["fast", "cascade"])
def test_the_gradient_reaches_all_that_learns(kind, exported):
    network = copy.deepcopy(exported[kind].network).train()
    round_to_bytes(network)
    left, right = (torch.randint(0, 256, (1, 3, 64, 192)).float() for _ in range(2))
    network(left, right).disparities[-1].sum().backward()
    learning = dict(network.refinement.named_parameters())
    assert learning
    for name, parameter in learning.items():
        assert parameter.grad is not None and parameter.grad.abs().sum() > 0, name
