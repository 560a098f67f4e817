import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import onnxruntime as ort
import pytest

from endosdk.errors import InvalidArgument
from endosdk.models import parse_metadata
from endosdk.training.quantize import describe_quantised, quantize_model
from tests.training.test_frame_size import OneFrame
from tests.training.warped_scenes import warped_pair


class Scenes(OneFrame):
    """Pairs with texture and depth, twice the width at which the network sees them."""

    def __init__(self):
        super().__init__(96, 960)
        self.pairs = [warped_pair(seed, (96, 960))[:2] for seed in range(4)]

    def __len__(self):
        return len(self.pairs)

    def __getitem__(self, index):
        left, right = self.pairs[index]
        return self.sample.__class__("0", left, right, self.sample.disparity, None, None, 400.0, 10.0)


class Files(NamedTuple):
    full: Path
    quantised: Path


@pytest.fixture(scope="module")
def files(exported, tmp_path_factory):
    files = Files(exported["fast"].path, tmp_path_factory.mktemp("quantised") / "int8.onnx")
    quantize_model(files.full, files.quantised, Scenes(), range(3))
    return files


def kinds(path):
    return [node.op_type for node in onnx.load(path).graph.node]


def run(path):
    left, right = (
        np.ascontiguousarray(view[:, ::2].transpose(2, 0, 1))[None] for view in warped_pair(9, (48, 192))[:2]
    )
    session = ort.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(["disparity", "confidence"], {"left": left, "right": right})


def test_the_answers_stay_close(files):
    exact, quantised = run(files.full), run(files.quantised)
    difference = np.abs(exact[0] - quantised[0])
    # Of random weights, which no training has made robust: steps of 8 bits, not another answer.
    assert 0 < difference.mean() < 0.02 * exact[0].mean()
    assert np.abs(exact[1] - quantised[1]).mean() < 0.05


def test_wide_layers_are_integers_and_the_answer_is_float(files):
    graph = onnx.load(files.quantised).graph
    makers = {name: node for node in graph.node for name in node.output}
    weights = {weight.name: weight for weight in graph.initializer}
    floats = []
    for conv in [node for node in graph.node if node.op_type == "Conv"]:
        weight = makers.get(conv.input[1])
        quantised = weight is not None and weight.op_type == "DequantizeLinear"
        channels = weights[weight.input[0] if quantised else conv.input[1]].dims[0]
        assert not quantised or channels >= 16
        if channels >= 16 and not quantised:
            floats.append(conv)
    # The one wide layer that reads disparities, and what was seen at them, beside each other.
    (hints,) = floats
    assert makers[hints.input[0]].op_type == "Concat"
    # The costs are made from 8-bit numbers, but are none themselves.
    dequantised = {node.output[0] for node in graph.node if node.op_type == "DequantizeLinear"}
    (cost,) = [node for node in graph.node if node.op_type == "MatMul" and dequantised.issuperset(node.input)]
    assert not [node for node in graph.node if node.op_type == "QuantizeLinear" and node.input[0] == cost.output[0]]
    # Nothing after the last float layer passes through 8 bits.
    assert makers[graph.output[0].name].op_type == "Relu"
    assert makers[makers[graph.output[0].name].input[0]].op_type == "Add"


def test_the_picture_is_read_as_bytes(files):
    graph = onnx.load(files.quantised).graph
    casts = [node for node in graph.node if node.op_type == "Cast" and node.input[0] in ("left", "right")]
    assert not casts
    assert "Cast" in kinds(files.full)


def test_the_file_still_describes_itself(files, tmp_path):
    copy = tmp_path / "quick.onnx"
    copy.write_bytes(files.quantised.read_bytes())
    describe_quantised(copy, "quick", {"name": "some set", "all": {"epe_px": 0.5}})
    properties = {entry.key: entry.value for entry in onnx.load(copy).metadata_props}
    info = parse_metadata(properties, hashlib.sha256(copy.read_bytes()).hexdigest())
    assert (info.name, info.output_stride, info.max_disparity, info.usual_width) == ("quick", 2, 40, 480)
    assert info.last_plane == 36
    assert info.training["quantisation"]["pairs"] == 3
    assert info.training["test"]["all"]["epe_px"] == 0.5


def test_ranges_need_pairs(files, tmp_path):
    with pytest.raises(InvalidArgument, match="at least one pair"):
        quantize_model(files.full, tmp_path / "out.onnx", Scenes(), [])
