"""Convert an exported float model to one that computes its large layers in 8-bit integers.

Static quantisation in the QDQ form of ONNX: weights signed per channel, so small that sums of products saturate on no
processor; activations unsigned per tensor, with ranges measured on rendered frames. The costs are products of 8-bit
numbers, and floats from there on: the softmax, the soft-argmin, every enlargement, thin convolutions (the correction)
and the confidence would lose accuracy by 8 bits and save no time.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import numpy_helper
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static

from endosdk import _core
from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument
from endosdk.io.progress import progress
from endosdk.training.byte_functions import compute_with_bytes, users_of
from endosdk.training.frame_size import seen_size, seen_views
from endosdk.training.integer_steps import LEAST_CHANNELS, convolution_steps, unsaturated_steps
from endosdk.training.model_file import properties_of, write_model
from endosdk.training.ranges import MOVES, VOLUME, Step, ranges_of

PREFIX = _core.model_key_prefix

Names = dict[str, onnx.NodeProto]


def quantize_model(source: Path, out: Path, reader: DatasetReader, indices: Sequence[int]) -> None:
    """Write the 8-bit form of the float model ``source`` to ``out``; ranges come from the given pairs of ``reader``."""
    if not indices:
        raise InvalidArgument("indices", "must name at least one pair to measure ranges on", "none")
    model = onnx.load(source)
    properties = properties_of(model)
    _quantize(source, model, out, _Frames(reader, indices, properties), {}, len(indices))


def read_ranges(path: Path) -> onnx.ModelProto:
    """Read an 8-bit file for `quantize_like`. Raises InvalidArgument where there is none."""
    try:
        return onnx.load(path)
    except (OSError, DecodeError) as error:
        raise InvalidArgument("ranges_of", "must be an 8-bit ONNX file", f"{path} ({error})") from error


def quantize_like(source: Path, out: Path, before: onnx.ModelProto) -> None:
    """Write the 8-bit form of the float model ``source`` to ``out``; ranges are those of the 8-bit model ``before``.

    It has the same weights, perhaps in an earlier release. Raises InvalidArgument for another model.
    """
    model = onnx.load(source)
    ranges = ranges_of(before.graph, model.graph, _quantised_nodes(model.graph))
    pairs = json.loads(properties_of(before).get(PREFIX + "training", "{}")).get("quantisation", {}).get("pairs", 0)
    blank = _Blank(int(properties_of(model)[PREFIX + "input_multiple"]))
    _quantize(source, model, out, blank, ranges, pairs)


def _quantize(
    source: Path,
    model: onnx.ModelProto,
    out: Path,
    frames: CalibrationDataReader,
    ranges: dict[str, Step],
    pairs: int,
) -> None:
    properties = properties_of(model)
    chosen = _quantised_nodes(model.graph)
    steps = _weight_steps(model.graph, chosen)
    ranges = ranges | _bytes_of_pictures(model.graph, chosen)
    steps |= {name: [{"scale": scale, "zero_point": zero}] for name, (scale, zero) in ranges.items()}
    with tempfile.TemporaryDirectory() as folder:
        # Kept in memory, the quantiser would write the model to a folder of its own choice.
        draft = Path(folder) / "draft.onnx"
        quantize_static(
            source,
            draft,
            frames,
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            calibrate_method=CalibrationMethod.MinMax,
            nodes_to_quantize=chosen,
            op_types_to_quantize=["Conv", "MatMul", "Relu", "Add", "Concat", "Slice"],
            extra_options={
                "CalibMovingAverage": True,
                "OpTypesToExcludeOutputQuantization": ["MatMul"],
                "TensorQuantOverrides": steps,
            },
        )
        quantised = onnx.load(draft)
    read_bytes_directly(quantised.graph)
    compute_with_bytes(quantised)
    quantised.producer_name, quantised.producer_version = model.producer_name, model.producer_version
    training = json.loads(properties[PREFIX + "training"])
    training["quantisation"] = {"weights": "int8 per channel", "activations": "uint8", "pairs": pairs}
    properties[PREFIX + "training"] = json.dumps(training, sort_keys=True, separators=(",", ":"))
    del quantised.metadata_props[:]
    onnx.helper.set_model_props(quantised, properties)
    onnx.checker.check_model(quantised, full_check=True)
    write_model(quantised, out)


def describe_quantised(path: Path, name: str, test: dict[str, Any]) -> None:
    """Give the 8-bit file its own name and the scores it has itself reached on a test split."""
    model = onnx.load(path)
    properties = properties_of(model)
    training = {**json.loads(properties[PREFIX + "training"]), "test": test}
    properties |= {
        PREFIX + "name": name,
        PREFIX + "training": json.dumps(training, sort_keys=True, separators=(",", ":")),
    }
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, properties)
    write_model(model, path)


def read_bytes_directly(graph: onnx.GraphProto) -> None:
    """Take the picture's bytes as 8-bit values of step 1, instead of making floats of them and quantising those again.

    Removes Cast and QuantizeLinear before a DequantizeLinear of scale 1, in place.
    """
    users = users_of(graph)
    removed: list[str] = []
    for cast in [node for node in graph.node if node.op_type == "Cast"]:
        following = users.get(cast.output[0], [])
        if len(following) != 1 or following[0].op_type != "QuantizeLinear":
            continue
        removed += [cast.name, following[0].name]
        for dequantise in users[following[0].output[0]]:
            dequantise.input[0] = cast.input[0]
    kept = [node for node in graph.node if node.name not in removed]
    del graph.node[:]
    graph.node.extend(kept)


def _bytes_of_pictures(graph: onnx.GraphProto, nodes: Sequence[str]) -> dict[str, Step]:
    """Return the steps of the picture's bytes where one of these nodes reads them: known, and not to be measured."""
    casts = {node.output[0] for node in graph.node if node.op_type == "Cast"}
    read = {name for node in graph.node if node.name in nodes for name in node.input}
    return {name: (np.array(1.0, np.float32), np.array(0, np.uint8)) for name in casts & read}


def _quantised_nodes(graph: onnx.GraphProto) -> list[str]:
    """Name the nodes to quantise: convolutions of many channels, and what moves, adds or weighs their results.

    A convolution of values that were computed in floats stays in floats: disparities and what was seen at them differ
    so much in size, from channel to channel, that one scale of 256 steps for all would lose the small ones.
    """
    makers = {name: node for node in graph.node for name in node.output}
    weights = {weight.name: weight.dims for weight in graph.initializer}
    chosen: set[str] = set()
    products: set[str] = set()  # whose results are floats
    for node in graph.node:  # in the order of computation
        if node.op_type == "Conv":
            large = weights[node.input[1]][0] >= LEAST_CHANNELS
            if large and all(source is None or source in chosen for source in _sources(node.input[0], makers)):
                chosen.add(node.name)
        elif node.op_type in (*MOVES, VOLUME, "Add", "MatMul"):
            if any(source in chosen for name in node.input for source in _sources(name, makers)):
                (products if node.op_type == "MatMul" else chosen).add(node.name)
    return [node.name for node in graph.node if node.name in chosen | products]


def _weight_steps(graph: onnx.GraphProto, nodes: Sequence[str]) -> dict[str, list[dict[str, Any]]]:
    """Choose the steps of all weights to quantise, in the quantiser's form, by `unsaturated_steps`.

    Those of convolutions have one for each output channel; runtimes multiply matrices by weights of a single step.
    """
    weights = {weight.name: weight for weight in graph.initializer}
    chosen: dict[str, list[dict[str, Any]]] = {}
    for node in graph.node:
        if node.name not in nodes or node.op_type not in ("Conv", "MatMul") or node.input[1] not in weights:
            continue
        values = numpy_helper.to_array(weights[node.input[1]])
        if node.op_type == "Conv":
            steps, place = convolution_steps(values), {"axis": 0}
        else:
            steps, place = unsaturated_steps(values.T).max(keepdims=True), {}
        chosen[node.input[1]] = [{"scale": step, "zero_point": np.array(0, np.int8)} for step in steps]
        chosen[node.input[1]][0] |= place
    return chosen


def _sources(name: str, makers: Names) -> set[str | None]:
    """Name the nodes that compute a value, before it is moved; None stands for the pictures, which are bytes."""
    node = makers.get(name)
    if node is None or node.op_type in ("Cast", "ReadSmaller"):  # means of bytes are as large as bytes
        return {None}
    if node.op_type not in MOVES:
        return {node.name}
    inputs = node.input if node.op_type == "Concat" else node.input[:1]
    return set().union(*(_sources(each, makers) for each in inputs))


class _Blank(CalibrationDataReader):  # type: ignore[misc]
    """Hands the quantiser one pair that says nothing: where all ranges are known."""

    def __init__(self, multiple: int) -> None:
        view = np.zeros((1, 3, 8 * multiple, 16 * multiple), np.uint8)
        self._feeds = iter([{"left": view, "right": view}])

    def get_next(self) -> dict[str, NDArray[np.uint8]] | None:
        """Return the pair, then None."""
        return next(self._feeds, None)


class _Frames(CalibrationDataReader):  # type: ignore[misc]
    """Hands the quantiser one pair after the other, as the model sees them."""

    def __init__(self, reader: DatasetReader, indices: Sequence[int], properties: dict[str, str]) -> None:
        self._feeds = self._read(reader, indices, properties)

    def get_next(self) -> dict[str, NDArray[np.uint8]] | None:
        """Return the next pair, None after the last."""
        return next(self._feeds, None)

    @staticmethod
    def _read(reader: DatasetReader, indices: Sequence[int], properties: dict[str, str]) -> Iterator[dict[str, Any]]:
        multiple = int(properties[PREFIX + "input_multiple"])
        inference_width = properties.get(PREFIX + "inference_width")
        for index in progress(indices, title="measuring ranges"):
            sample = reader[index]
            height, width = sample.left.shape[:2]
            size = seen_size(width, height, None if inference_width is None else int(inference_width))
            views = seen_views(sample.left, sample.right, size, multiple)
            yield {name: view[None] for name, view in zip(("left", "right"), views, strict=True)}
