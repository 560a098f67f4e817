"""Functions of exported files: by their bodies, as any runtime computes them, and by our own loops."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from onnx import TensorProto, helper

from endosdk.runtime.session import compute_functions
from endosdk.training.networks.functions import MARKS, as_function
from endosdk.training.outline import DOMAIN, outline_functions

FUNCTIONS = {
    "ReadViews",
    "PlanesAround",
    "AnswerOfPlanes",
    "CompareViews",
    "ChooseSurface",
    "VolumeOfPairs",
    "ThinConvolution",
    "MatchEvidence",
    "CluesOfAnswer",
    "ScaleOfErrors",
    "ConfidenceOfScale",
}


def session_of(path: Path, own: bool) -> Any:
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    if own:
        compute_functions(options)
    return onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])


def test_files_hold_functions_and_calls(exported: Any) -> None:
    model = onnx.load(exported["cascade"].path)
    calls = Counter(node.op_type for node in model.graph.node if node.domain == DOMAIN)
    assert calls == {
        "ReadViews": 1,
        "ReadSmaller": 1,
        "PlanesAround": 2,
        "AnswerOfPlanes": 1,
        "CompareViews": 3,
        "ChooseSurface": 3,
        "VolumeOfPairs": 1,
        "ThinConvolution": 3,
        "MatchEvidence": 1,
        "CluesOfAnswer": 2,
        "ScaleOfErrors": 2,
        "ConfidenceOfScale": 1,
    }
    for function in model.functions:
        assert {node.domain for node in function.node} == {""}  # what every runtime knows
    (answer,) = (node for node in model.graph.node if node.op_type == "AnswerOfPlanes")
    assert {entry.name for entry in answer.attribute} == {"dense", "sparse", "reach"}
    assert all(entry.domain != MARKS for entry in model.opset_import)


def test_a_function_computes_what_its_part_does() -> None:
    part = torch.nn.Softplus()
    values = torch.randn(3)
    assert torch.equal(as_function(Pair(part))(values)[0], part(values))


class Pair(torch.nn.Module):
    def __init__(self, part: torch.nn.Module) -> None:
        super().__init__()
        self.part = part

    def forward(self, values: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.part(values), values


def marked_model(*between: onnx.NodeProto) -> onnx.ModelProto:
    nodes = [
        helper.make_node("Begin", ["x"], ["in"], domain=MARKS, name="Twice"),
        *between,
        helper.make_node("End", ["out"], ["y"], domain=MARKS, name="Twice"),
    ]
    for node in (nodes[0], nodes[-1]):
        node.attribute.append(helper.make_attribute("name", "Twice"))
    graph = helper.make_graph(
        [helper.make_node("Shape", ["x"], ["sides"]), *nodes],
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n"])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n"])],
        [helper.make_tensor("two", TensorProto.FLOAT, [], [2.0])],
    )
    opsets = [helper.make_opsetid("", 18), helper.make_opsetid(MARKS, 1)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=10)


def test_constants_go_into_the_body_and_sizes_become_inputs() -> None:
    between = [helper.make_node("Mul", ["in", "two"], ["m"]), helper.make_node("Reshape", ["m", "sides"], ["out"])]
    model = marked_model(*between)
    outline_functions(model)
    onnx.checker.check_model(model, full_check=True)
    (function,) = model.functions
    assert [node.op_type for node in function.node] == ["Constant", "Mul", "Reshape"]
    (call,) = (node for node in model.graph.node if node.op_type == "Twice")
    assert list(call.input) == ["x", "sides"]
    assert not model.graph.initializer
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    np.testing.assert_array_equal(session.run(None, {"x": np.array([1, 3], np.float32)})[0], [2, 6])


def test_a_model_without_marks_stays_as_it_is() -> None:
    model = marked_model()
    del model.graph.node[1:]
    before = model.SerializeToString()
    outline_functions(model)
    assert model.SerializeToString() == before


@pytest.mark.parametrize(("kind", "size"), [("fast", (64, 96)), ("cascade", (64, 128))])
def test_a_file_computes_the_same_by_its_bodies(kind: str, size: tuple[int, int], exported: Any) -> None:
    network = exported[kind]
    names = {function.name for function in onnx.load(network.path).functions}
    assert names == FUNCTIONS if kind == "fast" else names == FUNCTIONS | {"ReadSmaller"}
    generator = np.random.default_rng(0)
    left, right = (generator.integers(0, 256, (2, 3, *size), np.uint8) for _ in range(2))
    by_bodies, by_loops = (
        session_of(network.path, own).run(["disparity", "confidence"], {"left": left, "right": right})
        for own in (False, True)
    )
    assert np.ptp(by_bodies[0]) > 1.0
    for one, other in zip(by_bodies, by_loops, strict=True):
        np.testing.assert_allclose(one, other, atol=2e-3)
    assert any((one != other).any() for one, other in zip(by_bodies, by_loops, strict=True))  # both ways were taken
