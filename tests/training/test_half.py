import numpy as np
import onnx
import onnxruntime as ort
import pytest
import torch
from onnx import TensorProto

from endosdk.training.export import ModelInfo, export_model
from endosdk.training.half import half_model
from endosdk.training.networks import build_network
from tests.training.test_networks import shaken
from tests.training.test_quantize import run
from tests.training.warped_scenes import warped_pair


@pytest.fixture(scope="module", params=["fast", "wang2020"])
def files(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("half")
    torch.manual_seed(1)
    network = shaken(build_network(request.param, max_disparity=32))
    export_model(network, folder / "full.onnx", ModelInfo(request.param, "1", training={"recipe": "none"}))
    half_model(folder / "full.onnx", folder / "half.onnx")
    return folder


def test_the_answers_agree_to_what_16_bits_allow(files):
    exact, half = run(files / "full.onnx"), run(files / "half.onnx")
    difference = np.abs(exact[0] - half[0])
    assert 0 < difference.mean() < 0.01 * exact[0].mean()
    assert np.abs(exact[1] - half[1]).mean() < 0.01


def test_weights_are_halved_and_the_soft_argmin_is_exact(files):
    full, half = onnx.load(files / "full.onnx"), onnx.load(files / "half.onnx")
    kinds = {weight.name: weight.data_type for weight in half.graph.initializer}
    convolutions = [node for node in half.graph.node if node.op_type == "Conv"]
    assert {kinds[node.input[1]] for node in convolutions} == {TensorProto.FLOAT16}
    assert (files / "half.onnx").stat().st_size < 0.7 * (files / "full.onnx").stat().st_size
    makers = {name: node for node in half.graph.node for name in node.output}
    # The first exponential of `fast` is that of its soft-argmin, which has no softmax of its own.
    softmax = next(node for node in half.graph.node if node.op_type in ("Softmax", "Exp"))
    before = makers[softmax.input[0]]
    while before.op_type != "Cast":
        before = makers[before.input[0]]
    assert before.attribute[0].i == TensorProto.FLOAT
    assert {entry.key: entry.value for entry in half.metadata_props} == {
        entry.key: entry.value for entry in full.metadata_props
    }
    for value in (*half.graph.input, *half.graph.output):
        assert value.type.tensor_type.elem_type in (TensorProto.UINT8, TensorProto.FLOAT)


def test_places_in_the_pictures_are_known_to_more_than_16_bits(tmp_path):
    """Columns of a wide frame: 16 bits would move them by up to a quarter of a pixel."""
    network = build_network("fast", max_disparity=32)
    export_model(network, tmp_path / "full.onnx", ModelInfo("fast", "1", training={"recipe": "none"}))
    half_model(tmp_path / "full.onnx", tmp_path / "half.onnx")
    left, right = (
        np.ascontiguousarray(view.transpose(2, 0, 1))[None] for view in warped_pair(9, (64, 640), (3.0, 26.0))[:2]
    )
    exact, half = (
        ort.InferenceSession(tmp_path / f"{name}.onnx", providers=["CPUExecutionProvider"]).run(
            ["disparity"], {"left": left, "right": right}
        )[0]
        for name in ("full", "half")
    )
    assert np.abs(exact - half)[..., 200:].mean() < 0.02
