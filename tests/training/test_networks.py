import pytest
import torch
import torch.nn.functional as F
from torch import nn

from endosdk.errors import InvalidArgument
from endosdk.training.data import planar
from endosdk.training.networks import build_network
from endosdk.training.networks.base import Window
from endosdk.training.networks.blocks import ConvNorm, fold_batch_norm
from endosdk.training.networks.cost_volume import (
    Aggregation,
    Planes,
    difference_planes,
    soft_argmin,
    soft_argmin_of_planes,
)
from endosdk.training.networks.fast import DifferenceVolume
from endosdk.training.networks.fast_export import PairedVolume, ReadViews, ViewRows, over_rows
from endosdk.training.networks.photometric import LIKELY_STEP
from endosdk.training.networks.wang2020_export import PlaneAggregation, in_blocks
from endosdk.training.train import channels_last
from tests.training.exported_networks import shaken
from tests.training.warped_scenes import warped_pair

# By name, not all that is known: benchmarks add networks to the list, which promise less.
OURS = ("fast", "wang2020", "wang2020-photometric")


def views(height=64, width=128, pairs=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [torch.rand((pairs, 3, height, width), generator=generator) * 255 for _ in range(2)]


def convolutions(network):
    return [module for module in network.modules() if isinstance(module, nn.Conv2d | nn.Conv3d)]


def test_wang2020_has_the_layers_of_the_paper():
    network = build_network("wang2020")
    kernels = {
        part: [tuple(layer.weight.shape) for layer in convolutions(getattr(network, part))]
        for part in ("down", "features", "aggregation", "refinement")
    }
    assert kernels["down"] == [(32, 3, 5, 5), (32, 32, 5, 5), (32, 32, 5, 5)]
    assert kernels["features"] == [(32, 32, 3, 3)] * 7
    assert kernels["aggregation"] == [(32, 32, 3, 3, 3)] * 4 + [(1, 32, 3, 3, 3)]
    assert kernels["refinement"] == [(32, 4, 3, 3)] + [(32, 32, 3, 3)] * 6 + [(1, 32, 3, 3)]
    assert len(convolutions(network)) == 23
    assert [layer.dilation[0] for layer in convolutions(network.refinement)] == [1, 1, 2, 4, 8, 1, 1, 1]
    assert [layer.stride[0] for layer in convolutions(network.down)] == [2, 2, 2]


def test_the_pictures_correct_the_coarse_map_of_the_same_network():
    plain, corrected = (shaken(build_network(name, 40)) for name in ("wang2020", "wang2020-photometric"))
    corrected.load_state_dict(plain.state_dict())
    left, right, _ = warped_pair(5, (64, 128))
    views = [planar(view)[None].float() for view in (left, right)]
    with torch.no_grad():
        rough, better = plain.coarse(*views), corrected.coarse(*views)
    moved = (better.disparity - rough.disparity).abs()
    assert 0.01 < moved.mean() and moved.max() <= LIKELY_STEP
    assert torch.equal(rough.evidence, better.evidence)


def test_fast_is_small():
    assert 0.2e6 < sum(p.numel() for p in build_network("fast").parameters()) < 0.5e6


@pytest.mark.parametrize("name", OURS)
def test_maps_have_the_promised_sizes(name):
    network = shaken(build_network(name))
    left, right = views()
    with torch.no_grad():
        coarse, both = network(left, right, refined=False), network(left, right)
    stride = network.output_stride
    shape = (2, 1, 64 // stride, 128 // stride)
    assert [m.shape for m in coarse.disparities] == [shape]
    assert [m.shape for m in both.disparities] == [shape, shape]
    assert torch.equal(coarse.disparities[0], both.disparities[0])
    for found in both.disparities:
        assert found.min() >= 0
    assert coarse.disparities[0].max() <= network.max_disparity - 8
    confidence = network.trust(both)
    assert confidence.shape == shape
    assert 0 <= confidence.min() <= confidence.max() <= 1


@pytest.mark.parametrize("name", OURS)
def test_an_untrained_refinement_changes_nothing_but_what_the_pictures_ask_for(name):
    torch.manual_seed(0)
    network = build_network(name)
    coarse = network.coarse(*views())
    rough, refined = network.refine(coarse).disparities
    wanted = rough
    if coarse.step is not None:
        belief, gate = torch.sigmoid(torch.tensor([1.0, -3.0]))
        wanted = wanted + belief * F.pixel_shuffle(coarse.step[:, :4], 2)
        for surface in coarse.step[:, 4:].split(1, dim=1):  # hardly taken at first
            wanted = wanted + gate * (F.interpolate(surface, scale_factor=2.0, mode="nearest") - rough)
    torch.testing.assert_close(wanted.clamp_min(0.0), refined)


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("window", [Window(64, 72, 40, 96), Window(0, 40, 136, 176), Window(0, 0, 168, 256)])
def test_a_window_gives_the_same_refinement_as_the_whole(name, window):
    network = shaken(build_network(name))
    left, right = views(168, 256)
    with torch.no_grad():
        whole, part = network(left, right), network(left, right, window=window)
    assert torch.equal(whole.disparities[0], part.disparities[0])
    expected = window.of(whole.disparities[1], network.output_stride)
    torch.testing.assert_close(part.disparities[1], expected, atol=1e-4, rtol=0)
    torch.testing.assert_close(part.evidence, window.of(whole.evidence, network.coarse_stride), atol=1e-4, rtol=0)


@pytest.mark.parametrize("name", OURS)
def test_the_export_form_computes_the_same(name):
    search = {"dense_disparity": 16, "mode_reach": 2} if name == "fast" else {}
    network = shaken(build_network(name, max_disparity=32, **search))
    form = network.export_form()
    left, right = views()
    with torch.no_grad():
        expected, found = network(left, right), form(left, right)
    for a, b in zip(expected.disparities, found.disparities, strict=True):
        torch.testing.assert_close(a, b, atol=3e-4, rtol=0)
    assert not any(isinstance(m, nn.BatchNorm2d | nn.BatchNorm3d | nn.Conv3d) for m in form.modules())
    assert any(isinstance(m, nn.BatchNorm2d | nn.BatchNorm3d) for m in network.modules())


def test_planes_need_folded_batch_norm():
    with pytest.raises(InvalidArgument, match="folded"):
        PlaneAggregation(Aggregation(4, planes=3, layers=1, slope=0.1))
    with pytest.raises(InvalidArgument, match="evaluation"):
        fold_batch_norm(nn.Sequential(ConvNorm(1, 1)))


@pytest.mark.parametrize("planes", [1, 2, 5])
def test_aggregation_plane_by_plane_equals_that_in_three_dimensions(planes):
    torch.manual_seed(planes)
    source = Aggregation(3, planes, layers=2, slope=0.1).eval()
    fold_batch_norm(source)
    left, right = torch.randn(2, 2, 3, 6, 9).double()
    with torch.no_grad():
        expected = source.double()(left, right)
        torch.testing.assert_close(PlaneAggregation(source).double()(left, right), expected, atol=1e-6, rtol=0)
    assert expected.shape == (2, 6, 9, planes) and expected.std() > 0.1


def test_a_convolution_in_blocks_equals_one_pixel_by_pixel():
    torch.manual_seed(0)
    conv = nn.Conv2d(5, 1, 3, padding=1)
    values = torch.randn(2, 5, 8, 12)
    torch.testing.assert_close(in_blocks(conv)(values), conv(values), atol=1e-5, rtol=0)
    with pytest.raises(InvalidArgument, match="one channel"):
        in_blocks(nn.Conv2d(5, 2, 3, padding=1))


def test_differences_vanish_at_the_true_shift():
    features = torch.randn(1, 4, 3, 20, generator=torch.Generator().manual_seed(0))
    left = torch.roll(features, 5, dims=3)
    planes = difference_planes(left, features, 9)
    assert [plane.shape for plane in planes] == [(1, 4, 3, 20)] * 9
    assert torch.count_nonzero(planes[5][..., 5:]) == 0
    assert torch.equal(planes[5][..., :5], left[..., :5])
    assert torch.equal(planes[0], left - features)


def test_there_may_be_more_planes_than_columns():
    features = torch.ones(1, 1, 2, 3)
    rows = [plane[0, 0, 0].tolist() for plane in difference_planes(features, features, 6)]
    assert rows == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 1, 1], [1, 1, 1]]


def test_soft_argmin_of_certain_answers_has_no_excess():
    cost = torch.full((1, 1, 2, 5), 80.0)
    cost[0, 0, 0, 3] = 0.0  # exactly plane 3
    cost[0, 0, 1, 1:3] = 0.0  # half way between planes 1 and 2
    found = soft_argmin(cost)
    torch.testing.assert_close(found.disparity[0, 0, 0], torch.tensor([3.0, 1.5]))
    torch.testing.assert_close(found.excess[0, 0, 0], torch.zeros(2), atol=1e-5, rtol=0)


def test_soft_argmin_of_a_doubtful_answer_has_excess():
    cost = torch.full((1, 1, 1, 5), 80.0)
    cost[..., 0] = cost[..., 4] = 0.0  # either end: mean 2, variance 4
    found = soft_argmin(cost)
    assert found.disparity.item() == pytest.approx(2.0)
    assert found.excess.item() == pytest.approx(4.0, abs=1e-4)


@pytest.mark.parametrize("value", [0, -8, 70])
@pytest.mark.parametrize("name", OURS)
def test_the_range_is_a_multiple_of_eight(name, value):
    with pytest.raises(InvalidArgument, match="multiple of 8"):
        build_network(name, max_disparity=value)


def test_planes_lie_twice_as_far_apart_beyond_the_dense_ones():
    network = build_network("fast", 128, dense_disparity=48)
    assert network.candidates == (*range(0, 48, 4), *range(48, 128, 8))
    assert network.max_candidate_disparity == 120
    for dense in (44, 40, 136, 0):
        with pytest.raises(InvalidArgument, match="dense_disparity"):
            build_network("fast", 128, dense_disparity=dense)
    with pytest.raises(InvalidArgument, match="mode_reach"):
        build_network("wang2020", mode_reach=2)


def test_an_answer_is_found_between_planes_of_either_distance():
    planes = Planes(4, 3)  # 0 1 2 3 4 6 8
    shifts = torch.tensor(planes.shifts, dtype=torch.float32)
    for truth in (1.25, 3.5, 4.5, 7.0):
        # Nearly all of the distribution on the two planes around the truth, in the shares that have it as their mean.
        place = int((shifts <= truth).sum()) - 1
        share = (truth - shifts[place]) / (shifts[place + 1] - shifts[place])
        cost = torch.full((1, 1, 1, 7), 30.0)
        cost[..., place], cost[..., place + 1] = -torch.log(1 - share), -torch.log(share)
        found = soft_argmin(cost, planes)
        assert found.disparity.item() == pytest.approx(truth, abs=1e-4)
        assert found.excess.item() == pytest.approx(0.0, abs=1e-3)


def test_the_answer_is_one_of_two_peaks_and_nothing_between():
    cost = torch.tensor([9.0, 0.0, 9.0, 9.0, 9.0, 0.4, 9.0]).view(1, 1, 1, 7)
    between, one = soft_argmin(cost), soft_argmin(cost, reach=1)
    assert 2.0 < between.disparity.item() < 3.0
    assert one.disparity.item() == pytest.approx(1.0, abs=1e-3)
    # The doubt is that of the whole distribution either way.
    torch.testing.assert_close(between.excess, one.excess)


def test_an_unknown_network_names_the_choices():
    with pytest.raises(InvalidArgument, match="wang2020"):
        build_network("wang2021")


@pytest.mark.parametrize("planes", [Planes(8), Planes(4, 4)])
def test_the_volume_of_fast_is_the_difference_at_every_shift(planes):
    torch.manual_seed(4)
    volume = DifferenceVolume(inputs=3, channels=2, planes=planes)
    left, right = torch.randn(2, 1, 3, 8, 32).unbind(0)
    found = volume(left, right)[0]
    assert found.shape == (8, 2, 4, 16)
    for plane, shift in enumerate(planes.shifts):
        # The plain way: move the right view by the shift and convolve at every second cell.
        moved = torch.nn.functional.pad(right, (shift, 0))[..., :32]
        expected = torch.relu(volume.match(left) - volume.match(moved))[0]
        # Where the kernel reaches cells that the shift has brought in from outside, the two fill up differently.
        inside = (shift + 1) // 2 + 1
        torch.testing.assert_close(found[plane][..., inside:], expected[..., inside:], atol=1e-5, rtol=0)
    paired = PairedVolume(volume.match, volume.planes)(left, right)
    pairs, height, width, both = paired[0].shape
    single = paired[0].view(pairs, height, width, 2, both // 2).permute(0, 3, 4, 1, 2).reshape(found.shape)
    torch.testing.assert_close(single, found, atol=1e-6, rtol=0)


@pytest.mark.parametrize("planes", [10, 80])
def test_soft_argmin_keeps_its_digits_within_autocast(planes):
    truth = torch.linspace(1.0, planes - 2.0, 1001)
    cost = (torch.arange(planes) - truth.view(1, 1, -1, 1)).abs() * 8.0
    with torch.autocast("cpu", torch.bfloat16):
        found = soft_argmin(cost.bfloat16())
    assert found.disparity.dtype == torch.float32
    torch.testing.assert_close(found.disparity, soft_argmin(cost.bfloat16().float()).disparity, rtol=0, atol=1e-5)
    assert len(found.disparity.unique()) > 900


@pytest.mark.parametrize("reach", [None, 1])
@pytest.mark.parametrize("planes", [Planes(6), Planes(2, 4)])
def test_soft_argmin_is_the_same_in_both_orders(planes, reach):
    cost = torch.randn(2, 3, 4, 6, generator=torch.Generator().manual_seed(3)) * 8 + 500  # far from what exp can take
    order = torch.tensor([0, 2, 4, 1, 3, 5])
    mixed = cost[..., order].flatten(1, 2).transpose(1, 2)
    one, other = soft_argmin(cost, planes, reach), soft_argmin_of_planes(mixed, planes, order.tolist(), reach)
    for a, b in zip(one, other, strict=True):
        torch.testing.assert_close(a.flatten(1), b.flatten(1), atol=1e-4, rtol=1e-4)


def test_a_stem_over_bytes_is_the_stem_over_pixels():
    views = torch.randint(0, 256, (2, 3, 8, 12), dtype=torch.uint8, generator=torch.Generator().manual_seed(5))
    rows, bright = ViewRows(ReadViews(4))(*views.chunk(2))
    assert rows.shape == (2, 12, 8, 3)
    conv = nn.Conv2d(3, 5, 4, stride=4)
    torch.testing.assert_close(over_rows(conv)(rows), conv(views.float()), atol=1e-3, rtol=0)
    torch.testing.assert_close(bright[0, 0, 1], views[0, :, 2:4].float().mean(dim=(0, 1)) / 64)


@pytest.mark.parametrize("planes", [1, 2, 3])
def test_two_backward_passes_in_bf16_agree(planes):
    """In torch's own arithmetic those of two planes differ by up to any number."""
    torch.manual_seed(0)
    aggregation = Aggregation(32, planes, layers=4, slope=0.2)
    channels_last(aggregation)
    left, right = torch.randn(2, 2, 32, 16, 32)
    gradients = []
    for _ in range(4):
        aggregation.zero_grad()
        with torch.autocast("cpu", dtype=torch.bfloat16):
            cost = aggregation(left, right)
        cost.float().square().sum().backward()
        gradients.append(torch.cat([weight.grad.flatten() for weight in aggregation.parameters()]))
    assert all(torch.equal(gradient, gradients[0]) for gradient in gradients)
