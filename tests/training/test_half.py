from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import TensorProto

from endosdk.training.half import half_model
from tests.training.test_quantize import run
from tests.training.warped_scenes import warped_pair


class Files(NamedTuple):
    full: Path
    half: Path


@pytest.fixture(scope="module", params=["fast", "wang2020"])
def files(request, exported, tmp_path_factory):
    files = Files(exported[request.param].path, tmp_path_factory.mktemp("half") / "half.onnx")
    half_model(*files)
    return files


def test_the_answers_agree_to_what_16_bits_allow(files):
    exact, half = run(files.full), run(files.half)
    difference = np.abs(exact[0] - half[0])
    assert 0 < difference.mean() < 0.01 * exact[0].mean()
    assert np.abs(exact[1] - half[1]).mean() < 0.01


def test_weights_are_halved_and_the_soft_argmin_is_exact(files):
    full, half = onnx.load(files.full), onnx.load(files.half)
    kinds = {weight.name: weight.data_type for weight in half.graph.initializer}
    convolutions = [node for node in half.graph.node if node.op_type == "Conv"]
    assert {kinds[node.input[1]] for node in convolutions} == {TensorProto.FLOAT16}
    assert files.half.stat().st_size < 0.7 * files.full.stat().st_size
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


def test_places_in_the_pictures_are_known_to_more_than_16_bits(exported, tmp_path):
    """Columns of a wide frame: 16 bits would move them by up to a quarter of a pixel."""
    half_model(exported["fast"].path, tmp_path / "half.onnx")
    left, right = (
        np.ascontiguousarray(view.transpose(2, 0, 1))[None] for view in warped_pair(9, (64, 640), (3.0, 26.0))[:2]
    )
    exact, half = (
        ort.InferenceSession(path, providers=["CPUExecutionProvider"]).run(
            ["disparity"], {"left": left, "right": right}
        )[0]
        for path in (exported["fast"].path, tmp_path / "half.onnx")
    )
    assert np.abs(exact - half)[..., 200:].mean() < 0.02
