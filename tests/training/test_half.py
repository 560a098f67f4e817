from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import pytest
from onnx import TensorProto

from endosdk.training.half import halved
from tests.training.test_quantize import run


class Models(NamedTuple):
    full: Path
    half: onnx.ModelProto


@pytest.fixture(scope="module", params=["fast", "wang2020", "wang2020-photometric"])
def models(request, exported):
    file = exported[request.param].path
    return Models(file, halved(onnx.load(file)))


def test_the_answers_agree_to_what_16_bits_allow(models):
    exact, half = run(models.full), run(models.half.SerializeToString())
    difference = np.abs(exact[0] - half[0])
    assert 0 < difference.mean() < 0.01 * exact[0].mean()
    assert np.abs(exact[1] - half[1]).mean() < 0.01


def test_weights_are_halved_and_the_soft_argmin_is_exact(models):
    full, half = onnx.load(models.full), models.half
    kinds = {weight.name: weight.data_type for weight in half.graph.initializer}
    convolutions = [node for node in half.graph.node if node.op_type == "Conv"]
    assert {kinds[node.input[1]] for node in convolutions} == {TensorProto.FLOAT16}
    assert half.ByteSize() < 0.7 * full.ByteSize()
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


def test_places_in_the_pictures_are_known_to_more_than_16_bits(exported):
    """Nothing between the convolutions and the columns looked at is rounded: 16 bits know column 600 to a half."""
    graph = halved(onnx.load(exported["fast"].path)).graph
    makers = {name: node for node in graph.node for name in node.output}
    waiting = [node.input[1] for node in graph.node if node.op_type == "GatherElements"]
    met = {}
    while waiting:
        node = makers.get(waiting.pop())
        if node is not None and node.op_type != "Conv" and node.output[0] not in met:
            met[node.output[0]] = node
            waiting.extend(node.input)
    assert {"Resize", "Floor"} < {node.op_type for node in met.values()}
    rounded = [node for node in met.values() if node.op_type == "Cast" and node.attribute[0].i == TensorProto.FLOAT16]
    assert not rounded
