import onnx
import pytest
import torch
import torch.nn.functional as F
from torch import nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks import build_network
from endosdk.training.networks.base import Window
from endosdk.training.networks.cascade import resized
from endosdk.training.networks.comparison import CELL, DISPARITY_HINT
from endosdk.training.parity import check_parity, parity_pairs
from endosdk.training.quantize import quantize_model
from tests.training.exported_networks import shaken
from tests.training.test_networks import views
from tests.training.test_quantize import Scenes
from tests.training.warped_scenes import warped_pair

RANGE, DENSE = 128, 64  # px; the first stage searches 3/4 of it


def cascade():
    torch.manual_seed(1)
    return build_network("cascade", RANGE, dense_disparity=DENSE, mode_reach=2)


def test_the_first_stage_searches_the_whole_range_on_a_smaller_picture():
    network = cascade()
    assert network.first.candidates == (*range(0, 48, 4), *range(48, 96, 8))
    assert network.max_candidate_disparity == 117  # the last plane, 88 px there, lies at 117.3
    left, right = views(64, 128)
    seen = []
    network.first.pixels.register_forward_hook(lambda _, inputs, found: seen.append(inputs))
    with torch.no_grad():
        shaken(network)(left, right)
    ((*smaller,),) = seen
    for small, view in zip(smaller, (left, right), strict=True):
        assert small.shape == (len(view), 3, 48, 96)
        ramp = torch.arange(128.0).expand(1, 3, 64, 128)
        torch.testing.assert_close(resized(ramp, (48, 96))[0, 0, 0], (torch.arange(96) + 0.5) * 4 / 3 - 0.5)
        torch.testing.assert_close(small, resized(view, (48, 96)))


def test_disparities_of_the_first_stage_are_in_pixels_of_the_frame():
    network = cascade().eval()
    smooth = torch.full((2, 1, 24, 48), 30.0)
    refine = network.first.refine
    network.first.refine = lambda coarse: refine(coarse)._replace(disparities=[smooth])
    start = torch.tensor([0.0, -50.0, -50.0, -50.0]).repeat_interleave(4)
    with torch.no_grad():
        network.earlier.last.bias.copy_(start)
        torch.testing.assert_close(network.coarse(*views(64, 128)).disparity, torch.full((2, 1, 16, 32), 40.0))


def test_the_second_look_starts_from_the_answer_to_the_first():
    network = cascade().eval()
    start = torch.tensor([0.0, -50.0, -50.0, -50.0]).repeat_interleave(4)  # adds nothing to what was found
    found = []

    refine = network.first.refine

    def keep(coarse):
        prediction = refine(coarse)
        found.append(resized(prediction.disparities[-1], (16, 32)) * (4 / 3))
        return prediction

    network.first.refine = keep
    with torch.no_grad():
        for nearer in (0.0, 8.0):
            network.earlier.last.bias.copy_(start + torch.tensor([nearer, 0.0, 0.0, 0.0]).repeat_interleave(4))
            left, right = views(64, 128)
            coarse = network.coarse(left, right)
            smooth = F.avg_pool2d(network.on_answer_grid(found[-1]), 2)
            torch.testing.assert_close(coarse.disparity, smooth + nearer, atol=1e-4, rtol=0)
            hint = coarse.hints[:, DISPARITY_HINT : DISPARITY_HINT + 1]
            torch.testing.assert_close(hint, coarse.disparity / CELL)


def test_it_starts_with_the_first_answer_and_can_take_a_surface_nearby():
    network = cascade().eval()
    coarse = network.coarse(*views(64, 128))
    step, near, far = torch.split(coarse.step, [4, 1, 1], dim=1)
    assert torch.all(far <= coarse.disparity) and torch.all(coarse.disparity <= near) and (near - far).max() > 1.0
    rough, refined = network.refine(coarse).disparities
    near, far = (F.interpolate(part, scale_factor=2.0, mode="nearest") for part in (near, far))
    belief, gate = torch.sigmoid(torch.tensor([1.0, -3.0]))
    wanted = rough + belief * F.pixel_shuffle(step, 2) + gate * (near - rough) + gate * (far - rough)
    torch.testing.assert_close(refined, wanted.clamp_min(0.0))
    with torch.no_grad():
        network.refinement.last.bias.copy_(torch.tensor([0.0, -50.0, 50.0, -50.0]).repeat_interleave(4))
        torch.testing.assert_close(network.refine(coarse).disparities[1], near, atol=1e-4, rtol=0)


def test_a_window_gives_the_same_refinement_as_the_whole():
    network = shaken(cascade())
    left, right = views(192, 384)
    window = Window(64, 160, 32, 96)
    with torch.no_grad():
        whole, part = network(left, right), network(left, right, window=window)
    torch.testing.assert_close(part.disparities[1], window.of(whole.disparities[1], 2), atol=1e-3, rtol=0)
    torch.testing.assert_close(part.evidence, window.of(whole.evidence, 4), atol=1e-4, rtol=0)


def test_only_the_second_stage_learns():
    network = cascade().train()
    before = {name: value.clone() for name, value in network.first.state_dict().items()}
    network(*views(64, 128)).disparities[-1].mean().backward()
    assert all(parameter.grad is None for parameter in network.first.parameters())
    for part in (network.earlier, network.refinement):
        assert part.last.bias.grad is not None
    assert network.stem.conv.weight.grad is not None
    for name, value in network.first.state_dict().items():
        assert torch.equal(value, before[name]), name


def test_it_takes_the_weights_of_fast():
    fast = shaken(build_network("fast", 96, dense_disparity=48, mode_reach=2))
    network = cascade()
    network.load_state_dict(network.adapted(fast.state_dict(), 96, 48))
    for name, value in fast.state_dict().items():
        assert torch.equal(network.first.state_dict()[name], value)
    again = cascade()
    again.load_state_dict(again.adapted(network.state_dict(), RANGE, DENSE))


def test_the_file_computes_what_the_network_does(exported):
    network = exported["cascade"].network
    report = check_parity(network, exported["cascade"].path, parity_pairs(*warped_pair(5, (96, 160))[:2]))
    assert report["largest_px"] < 1e-3
    form = network.export_form()
    assert not any(isinstance(module, nn.BatchNorm2d) for module in form.modules())


def test_both_stages_run_in_integers(exported, tmp_path):
    quantize_model(exported["cascade"].path, tmp_path / "int8.onnx", Scenes(), range(2))
    graph = onnx.load(tmp_path / "int8.onnx").graph
    makers = {name: node for node in graph.node for name in node.output}
    weights = {weight.name: weight for weight in graph.initializer}
    kinds = {tuple(weight.dims): weight.data_type for weight in graph.initializer}
    # One scale for both would leave the correction steps of an eighth of a pixel.
    correction, gates = kinds[(4, 32, 3, 3)], kinds[(12, 32, 3, 3)]
    assert (correction, gates) == (onnx.TensorProto.FLOAT, onnx.TensorProto.INT8)
    wide = [node for node in graph.node if node.op_type == "Conv" and node.input[1] in weights]
    floats = [conv for conv in wide if weights[conv.input[1]].dims[0] >= 16]
    # As in `Fast`, one layer of each refinement reads disparities beside what was seen at them.
    assert [makers[conv.input[0]].op_type for conv in floats] == ["CompareViews"] * 3


@pytest.mark.parametrize("value", [0, -64, 144])
def test_the_range_is_a_multiple_of_64(value):
    with pytest.raises(InvalidArgument, match="max_disparity: must be a positive multiple of 64"):
        build_network("cascade", max_disparity=value)


@pytest.mark.parametrize("value", [0, -64, 32, 192])
def test_dense_planes_end_at_a_multiple_of_64_within_the_range(value):
    with pytest.raises(InvalidArgument, match=rf"dense_disparity: .* max_disparity {RANGE}; got {value} "):
        build_network("cascade", max_disparity=RANGE, dense_disparity=value)
