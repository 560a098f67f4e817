"""AnyNet and PSMNet: sizes as published, trained and exported by the loop of our own networks."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

import benchmarks.methods.networks  # noqa: F401  makes the published networks known
from benchmarks.methods.anynet import _residual_volume
from benchmarks.methods.costs import count_macs, network_costs, step_gmacs
from benchmarks.methods.planes import PlaneConv, PlaneConvTranspose
from benchmarks.methods.propagation import Propagation
from endosdk.datasets.dataset import SPLITS, Sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.errors import InvalidArgument
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks import build_network
from endosdk.training.networks.base import Window
from endosdk.training.parity import check_parity
from endosdk.training.run_log import LOG_COLUMNS
from endosdk.training.train import train
from tests.training.warped_scenes import constant_pair, warped_pair

# Stated by the authors: 5.2 M for PSMNet, about 43 k for AnyNet.
PUBLISHED = {"psmnet": (5_224_768, 5_224_768), "anynet": (42_500, 43_500)}


@pytest.fixture(autouse=True, scope="module")
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("name", ["anynet", "psmnet"])
def test_parameters_are_as_many_as_published(name):
    low, high = PUBLISHED[name]
    assert low <= network_costs(name, 192, 720, 960).params <= high


def test_macs_of_known_layers():
    # wang2020's own count at 960 x 720 without anything learned: from the sizes of its layers.
    pixels, cells, planes = 960 * 720, 120 * 90, 9
    down = 2 * 25 * 32 * (3 * pixels // 4 + 32 * pixels // 16 + 32 * cells)
    features = 2 * 7 * 9 * 32 * 32 * cells
    volume = planes * cells * 27 * (4 * 32 * 32 + 32)
    refinement = 9 * pixels * (4 * 32 + 6 * 32 * 32 + 32)
    moments = cells * planes * 2
    assert count_macs("wang2020", 72, 720, 960) == down + features + volume + refinement + moments
    assert step_gmacs("wang2020", 72, (720, 960), 2) == pytest.approx(6 * count_macs("wang2020", 72, 720, 960) / 1e9)


def test_frame_that_a_network_sees_reduced_is_counted_so():
    assert network_costs("fast", 96, 720, 960).gmacs == pytest.approx(count_macs("fast", 96, 360, 480) / 1e9)


@pytest.mark.parametrize("name", ["anynet", "psmnet"])
def test_maps_have_the_size_of_the_frame_and_every_weight_learns(name):
    network = build_network(name, 32).train()
    left, right, _ = constant_pair(1, (64, 96), 6)
    views = [torch.from_numpy(view).permute(2, 0, 1)[None].float() for view in (left, right)]
    torch.manual_seed(0)
    maps = network(*views).disparities
    assert len(maps) == len(network.stage_weights)
    assert {tuple(found.shape) for found in maps} == {(1, 1, 64, 96)}
    sum((found - 6).square().mean() for found in maps).backward()
    idle = [key for key, value in network.named_parameters() if value.grad is None]
    assert not idle
    assert len(network.eval()(*views).disparities) == 2
    assert len(network(*views, refined=False).disparities) == 1


@pytest.mark.parametrize("name", ["anynet", "psmnet"])
def test_wrong_range_and_windows_are_refused(name):
    with pytest.raises(InvalidArgument, match="multiple of 16"):
        build_network(name, 72)
    picture = torch.zeros(1, 3, 32, 32)
    with pytest.raises(InvalidArgument, match="refine_crop"):
        build_network(name, 32)(picture, picture, window=Window(0, 0, 16, 16))


def test_last_stage_of_anynet_learns_late_and_in_whole_floats():
    network = build_network("anynet", 32).train()
    left, right, _ = constant_pair(1, (64, 96), 6)
    views = [torch.from_numpy(view).permute(2, 0, 1)[None].float() for view in (left, right)]
    with torch.autocast("cpu", dtype=torch.bfloat16):
        early, late = network(*views, refined=False).disparities, network(*views).disparities
    assert (len(early), len(late)) == (3, 4)
    assert late[3].dtype == torch.float32
    # In 16 bits a map around 40 px has steps of a quarter of a pixel; this one has every value.
    shifted = network.refinement(torch.full((1, 1, 16, 24), 40.0) + torch.rand(1, 1, 16, 24), torch.rand(1, 3, 16, 24))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert network.refinement(torch.rand(1, 1, 16, 24), torch.rand(1, 3, 16, 24)).dtype == torch.float32
    assert shifted.unique().numel() > 300
    assert len(network.eval()(*views, refined=False).disparities) == 1


def test_planes_of_the_whole_range_end_with_the_largest_disparity():
    whole, ours = build_network("wang2020-whole-range", 32), build_network("wang2020", 32)
    assert (whole.aggregation.planes, whole.max_candidate_disparity) == (5, 32)
    assert (ours.aggregation.planes, ours.max_candidate_disparity) == (4, 24)
    assert {name: value.shape for name, value in whole.state_dict().items()} == {
        name: value.shape for name, value in ours.state_dict().items()
    }
    assert whole.eval().export_form().aggregation.planes == 5
    # Where all planes cost the same the answer is their mean: half the range with the last plane, less without it.
    picture = torch.zeros(1, 3, 64, 96)
    for network, mean in ((whole, 16.0), (ours.eval(), 12.0)):
        nn.init.zeros_(network.aggregation.cost.weight)
        with torch.no_grad():
            assert float(network(picture, picture).disparities[0].mean()) == pytest.approx(mean, abs=0.1)


def test_propagation_is_that_of_the_twin():
    generator = torch.Generator().manual_seed(0)
    values, gates = torch.randn(1, 2, 5, 7, generator=generator), torch.randn(1, 6, 5, 7, generator=generator)
    found = Propagation()(values, gates).numpy()
    three = gates.numpy().reshape(1, 3, 2, 5, 7)
    three = three / np.abs(three).sum(axis=1, keepdims=True)
    expected = np.zeros((1, 2, 5, 8 + 1))  # one column before the first
    for x in range(7):
        for y in range(5):
            neighbours = [expected[:, :, row, x] if 0 <= row < 5 else 0.0 for row in (y - 1, y, y + 1)]
            share = three[:, :, :, y, x]
            flow = sum(share[:, i] * neighbours[i] for i in range(3))
            expected[:, :, y, x + 1] = (1 - share.sum(axis=1)) * values.numpy()[:, :, y, x] + flow
    assert np.allclose(found, expected[..., 1:8], atol=1e-5)


def test_residual_volume_has_its_minimum_at_the_true_shift():
    generator = torch.Generator().manual_seed(0)
    right = torch.rand(1, 4, 6, 30, generator=generator)
    left = torch.roll(right, 5, dims=3)
    volume = _residual_volume(left, right, torch.full((1, 1, 6, 30), 4.0))  # one cell short
    inner = volume[..., 8:-8]
    assert (inner.argmin(dim=1) == 3).all()  # index 2 is no correction
    assert inner[:, 3].abs().max() < 1e-5


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("bias", [False, True])
def test_convolution_over_planes_is_the_3d_one(stride, bias):
    torch.manual_seed(0)
    source = nn.Conv3d(3, 5, 3, stride, 1, bias=bias).double()
    volume = torch.randn(2, 3, 6, 8, 10, dtype=torch.double)
    assert torch.allclose(PlaneConv(source)(volume), source(volume), atol=1e-12)


def test_transposed_convolution_over_planes_is_the_3d_one():
    torch.manual_seed(0)
    source = nn.ConvTranspose3d(3, 5, 3, stride=2, padding=1, output_padding=1).double()
    volume = torch.randn(2, 3, 4, 5, 6, dtype=torch.double)
    assert torch.allclose(PlaneConvTranspose(source)(volume), source(volume), atol=1e-12)


def test_convolutions_of_other_shapes_are_refused():
    for source in (nn.Conv3d(2, 2, 5, padding=2), nn.Conv3d(2, 2, 3), nn.Conv3d(2, 2, 3, (1, 2, 2), 1)):
        with pytest.raises(InvalidArgument, match="3x3x3"):
            PlaneConv(source)
    with pytest.raises(InvalidArgument, match="3x3x3"):
        PlaneConvTranspose(nn.ConvTranspose3d(2, 2, 2, stride=2))


def with_statistics(name):
    """Build a network whose norms have seen a pair and whose scores are mild.

    Without that an untrained one drowns in its own activations: it answers by whole planes, and rounding flips them.
    """
    torch.manual_seed(0)
    network = build_network(name, 32).train()
    lasts = [head[-1] for head in network.heads] if name == "psmnet" else [cost[-1][-1] for cost in network.costs]
    for last in lasts:
        nn.init.normal_(last.weight, std=1e-3 if name == "psmnet" else 1e-2)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
            module.momentum = 1.0
    left, right, _ = constant_pair(1, (64, 96), 6)
    with torch.no_grad():
        network(*(torch.from_numpy(view).permute(2, 0, 1)[None].float() for view in (left, right)))
    return network.eval()


@pytest.mark.parametrize(("name", "norms_left"), [("anynet", 8), ("psmnet", 0)])
def test_export_form_computes_the_same_without_3d_convolutions(name, norms_left):
    network = with_statistics(name).double()
    form = network.export_form()
    views = 255 * torch.rand(2, 1, 3, 32, 48, dtype=torch.double)
    with torch.no_grad():
        expected, found = network(*views), form(*views)
    assert expected.disparities[-1].std() > 0.1
    assert torch.allclose(found.disparities[-1], expected.disparities[-1], atol=1e-6)
    assert torch.allclose(found.evidence, expected.evidence, atol=1e-6)
    assert not any(isinstance(module, nn.Conv3d | nn.ConvTranspose3d) for module in form.modules())
    assert sum(isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d) for module in form.modules()) == norms_left


def test_file_of_psmnet_computes_what_torch_does_at_two_sizes(tmp_path):
    network = with_statistics("psmnet")
    export_model(network, tmp_path / "psmnet.onnx", ModelDescription(name="psmnet", version="1"), size_step=16)
    pairs = [constant_pair(2, size, 6)[:2] for size in ((96, 160), (75, 133))]
    report = check_parity(network, tmp_path / "psmnet.onnx", pairs)
    assert [entry["height"] for entry in report["sizes"]] == [96, 75]


@pytest.fixture(scope="module")
def tiny_set(tmp_path_factory):
    root = tmp_path_factory.mktemp("tiny")
    hashes = {split: {} for split in SPLITS}
    for split, seeds in (("train", range(4)), ("test", range(90, 91))):
        for seed in seeds:
            left, right, truth = warped_pair(seed, (64, 128), (3.0, 20.0))
            sample = Sample(f"{seed:03d}", left, right, truth, None, None, focal_px=100.0, baseline_mm=5.0)
            hashes[split][sample.id] = write_sample(root, split, sample)
    write_dataset_record(root, {"format_version": 1, "name": "tiny", "samples": hashes})
    return root


def test_loop_trains_resumes_and_saves_a_published_network(tiny_set, tmp_path):
    config = TrainConfig(
        network="anynet",
        max_disparity=32,
        data=(str(tiny_set),),
        held_out=1,
        batch=2,
        crop=(48, 96),
        steps=3,
        validate_every=3,
        device="cpu",
        precision="fp32",
        loss="smooth-l1",
        log_every=1,
    )
    train(config, tmp_path / "run")
    train(replace(config, steps=5), tmp_path / "run", resume=True)
    saved = checkpoint.load(tmp_path / "run")
    assert saved.step == 5
    assert saved.build().name == "anynet"
    rows = (tmp_path / "run/log.csv").read_text().splitlines()
    assert len(rows) == 6 and all(len(row.split(",")) == len(LOG_COLUMNS) for row in rows)
