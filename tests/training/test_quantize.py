import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import numpy_helper

from endosdk.errors import InvalidArgument
from endosdk.runtime.models import parse_metadata, shipped_models
from endosdk.training.integer_steps import LEAST_CHANNELS, unsaturated_steps
from endosdk.training.quantize import describe_quantised, quantize_like, quantize_model, read_ranges
from tests.training.one_frame import OneFrame
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


def run(path, pair=None, level=ort.GraphOptimizationLevel.ORT_ENABLE_ALL):
    left, right = (
        np.ascontiguousarray(view[:, ::2].transpose(2, 0, 1))[None] for view in pair or warped_pair(9, (48, 192))[:2]
    )
    options = ort.SessionOptions()
    options.graph_optimization_level = level
    session = ort.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    return session.run(["disparity", "confidence"], {"left": left, "right": right})


def constants(path):
    return {value.name: numpy_helper.to_array(value) for value in onnx.load(path).graph.initializer}


def integer_weights(path):
    """Weights of 8 bits, one row for each output, in the order in which runtimes take them."""
    graph = onnx.load(path).graph
    makers = {name: node for node in graph.node for name in node.output}
    values = {weight.name: numpy_helper.to_array(weight) for weight in graph.initializer}
    for node in graph.node:
        weight = makers.get(node.input[1]) if node.op_type in ("Conv", "MatMul") else None
        if weight is not None and weight.op_type == "DequantizeLinear":
            found = values[weight.input[0]].astype(int)
            rows = np.moveaxis(found, 1, -1) if node.op_type == "Conv" else found.T
            yield rows.reshape(len(rows), -1)


def largest_pair_sums(rows):
    """What two neighbours with the largest inputs can come to, in 255ths; the slow way."""
    for row in rows:
        for first, second in zip(row[::2], [*row[1::2], 0], strict=False):
            yield max(first, 0) + max(second, 0)
            yield -min(first, 0) - min(second, 0)


def test_ranges_of_a_file_serve_the_same_weights_exported_anew(files, tmp_path):
    quantize_like(files.full, tmp_path / "again.onnx", read_ranges(files.quantised))
    measured, taken = (constants(path) for path in (files.quantised, tmp_path / "again.onnx"))
    assert measured.keys() == taken.keys()
    differing = {name for name in measured if not np.array_equal(measured[name], taken[name])}
    # The border of a map has a range of its own where it is measured; taken, it has that of the map.
    assert {name.split("_")[0] for name in differing} <= {"slice"}
    one, other = run(files.quantised), run(tmp_path / "again.onnx")
    assert np.abs(one[0] - other[0]).mean() < 0.002 * one[0].mean()
    with pytest.raises(InvalidArgument, match="no 8-bit layer with the weights"):
        quantize_like(shipped_models()["accurate-fp32"], tmp_path / "other.onnx", read_ranges(files.quantised))
    with pytest.raises(InvalidArgument, match="no 8-bit layer with the weights"):
        quantize_like(files.full, tmp_path / "other.onnx", read_ranges(files.full))
    assert not (tmp_path / "other.onnx").exists()


@pytest.mark.parametrize("content", [None, b"no model"])
def test_a_file_without_ranges_is_refused_by_name(tmp_path, content):
    if content is not None:
        (tmp_path / "known.onnx").write_bytes(content)
    with pytest.raises(InvalidArgument, match=r"ranges_of: must be an 8-bit ONNX file; got .*known\.onnx"):
        read_ranges(tmp_path / "known.onnx")


def test_planes_move_as_bytes(files):
    model = onnx.load(files.quantised)
    makers = {name: node for node in model.graph.node for name in node.output}
    moves = [node for node in model.graph.node if node.op_type == "PlanesAroundBytes"]
    assert len(moves) == 2
    sources = []
    for move in moves:
        source = makers[move.input[0]]
        while source.op_type in ("Transpose", "Reshape"):
            source = makers[source.input[0]]
        sources.append(source)
    # The first moves planes of the volume, the second those of a layer over it.
    volume, layer = sources
    assert volume.op_type == "VolumeOfPairsBytes"
    assert layer.op_type == "QuantizeLinear"
    for place in (0, 3):
        features = makers[volume.input[place]]
        assert features.op_type == "Transpose"
        assert makers[features.input[0]].op_type == "QuantizeLinear"
    names = {function.name for function in model.functions}
    assert names.issuperset({"VolumeOfPairsBytes", "PlanesAroundBytes"})
    assert names.isdisjoint({"VolumeOfPairs", "PlanesAround"})


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
        assert not quantised or channels >= LEAST_CHANNELS
        if channels > LEAST_CHANNELS and not quantised:  # what shuffles pixels has as many, and reads floats
            floats.append(conv)
    # The one wide layer that reads disparities, and what was seen at them, beside each other.
    (hints,) = floats
    assert makers[hints.input[0]].op_type == "CompareViews"
    # The costs are made from 8-bit numbers, but are none themselves.
    dequantised = {node.output[0] for node in graph.node if node.op_type == "DequantizeLinear"}
    costs = [node for node in graph.node if node.op_type == "MatMul" and dequantised.issuperset(node.input)]
    assert len(costs) == 2  # of the volume, and what its surroundings correct
    quantisers = {node.input[0] for node in graph.node if node.op_type == "QuantizeLinear"}
    assert not quantisers & {cost.output[0] for cost in costs}
    # Nothing after the last float layer passes through 8 bits.
    assert makers[graph.output[0].name].op_type == "ChooseSurface"


@pytest.mark.parametrize("name", ["fresh", "fast", "fast-320", "accurate"])
def test_no_sum_of_two_products_leaves_16_bits(files, name):
    """A processor without VNNI adds two products of a byte and a weight in 16 bits, and stops at their end."""
    layers = list(integer_weights(files.quantised if name == "fresh" else shipped_models()[name]))
    assert len(layers) == (56 if name == "accurate" else 29)
    assert max(255 * total for rows in layers for total in largest_pair_sums(rows)) <= 32767


def test_bright_pictures_are_computed_as_in_floats(files):
    """Where sums saturate, it shows at the largest inputs: white glare. A runtime that may not fuse computes floats."""
    left, right = (np.where(view > 90, 255, 0).astype(np.uint8) for view in warped_pair(9, (48, 192))[:2])
    assert 0.3 < (left == 255).mean() < 0.9
    integers = run(files.quantised, (left, right))
    floats = run(files.quantised, (left, right), ort.GraphOptimizationLevel.ORT_DISABLE_ALL)
    assert np.abs(integers[0] - floats[0]).mean() < 0.004 * floats[0].mean()


@pytest.mark.parametrize("count", [2, 7, 288])
def test_steps_are_no_larger_than_pairs_ask_for(count):
    weights = np.random.default_rng(count).standard_normal((40, count)).astype(np.float32)
    weights[0] = 0
    weights[1, :2] = 1, -1  # of two signs: nothing to add
    weights[1, 2:] *= 0.01
    steps = unsaturated_steps(weights)
    rounded = np.rint(weights / steps[:, None])
    sums = np.array(list(largest_pair_sums(rounded))).reshape(40, -1).max(axis=1)
    assert sums.max() <= 128
    assert (sums[1:] >= 126).all()
    assert (steps > 0).all()
    np.testing.assert_allclose(steps[1], 1 / 127)


def test_the_picture_is_read_as_bytes(files):
    graph = onnx.load(files.quantised).graph
    casts = [node for node in graph.node if node.op_type == "Cast" and node.input[0] in ("left", "right")]
    assert not casts
    assert "Cast" in kinds(files.full)


def test_the_first_bias_has_the_steps_of_the_products_it_is_added_to(files):
    """Else the runtime computes the first layer in floats."""
    graph = onnx.load(files.quantised).graph
    values = {value.name: numpy_helper.to_array(value) for value in graph.initializer}
    makers = {name: node for node in graph.node for name in node.output}
    first = next(node for node in graph.node if node.op_type == "Conv")
    picture, weight, bias = (makers[name] for name in first.input)
    assert values[picture.input[1]] == 1.0
    np.testing.assert_array_equal(values[bias.input[1]], values[weight.input[1]])
    floats = {value.name: numpy_helper.to_array(value) for value in onnx.load(files.full).graph.initializer}
    expected = next(floats[name] for name in floats if name.endswith("stem.0.bias"))
    found = values[bias.input[0]] * values[bias.input[1]].astype(np.float64)
    assert np.abs(found - expected).max() <= 2 * values[bias.input[1]].max()


def test_the_file_still_describes_itself(files, tmp_path):
    copy = tmp_path / "quick.onnx"
    copy.write_bytes(files.quantised.read_bytes())
    describe_quantised(copy, "quick", {"name": "some set", "all": {"epe_px": 0.5}})
    properties = {entry.key: entry.value for entry in onnx.load(copy).metadata_props}
    info = parse_metadata(properties, hashlib.sha256(copy.read_bytes()).hexdigest())
    assert (info.name, info.output_stride, info.max_disparity, info.inference_width) == ("quick", 2, 40, 480)
    assert info.max_candidate_disparity == 36
    assert info.training["quantisation"]["pairs"] == 3
    assert info.training["test"]["all"]["epe_px"] == 0.5


def test_ranges_need_pairs(files, tmp_path):
    with pytest.raises(InvalidArgument, match="at least one pair"):
        quantize_model(files.full, tmp_path / "out.onnx", Scenes(), [])
