"""Ranges of an 8-bit file, for the same network exported anew: without the pairs on which they were measured."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import numpy_helper

from endosdk.errors import InvalidArgument

OVER_BYTES = "PlanesAround"  # a function that only moves values
VOLUME = "VolumeOfPairs"  # a function that adds values

# Operators whose results lie in the range of their first input, and have its steps.
MOVES = (
    "Unsqueeze",
    "Reshape",
    "Slice",
    "Concat",
    "Pad",
    "Relu",
    "Squeeze",
    "Transpose",
    "Gather",
    "Split",
    OVER_BYTES,
)

Step = tuple[NDArray[Any], NDArray[Any]]  # scale and zero point


def ranges_of(known: onnx.GraphProto, graph: onnx.GraphProto, nodes: Collection[str]) -> dict[str, Step]:
    """Return the steps of the values around these nodes of a float graph, as an 8-bit file of the network has them.

    Layers are known by the names of their weights. Raises InvalidArgument for a file without one of them.
    """
    read, given = _layers(known)
    found: dict[str, Step] = {}
    for node in (node for node in graph.node if node.op_type == "Conv"):
        weights = node.input[1]
        if node.name in nodes:
            if weights not in read:
                rule = "must be an 8-bit file of the network that is exported"
                raise InvalidArgument("ranges_of", rule, f"no 8-bit layer with the weights {weights}")
            found[node.input[0]] = read[weights]
        if weights in given:  # a layer in floats has a range, too, where its result joins those of others
            found[node.output[0]] = given[weights]
    while _spread(graph, found):
        pass
    return found


def _layers(known: onnx.GraphProto) -> tuple[dict[str, Step], dict[str, Step]]:
    """Return the steps of what layers read in 8 bits, and of what they give, by the name of their weights."""
    makers = {name: node for node in known.node for name in node.output}
    values = {value.name: value for value in known.initializer}
    quantisers = {node.input[0]: node for node in known.node if node.op_type == "QuantizeLinear"}

    def step(node: onnx.NodeProto) -> Step:
        return _step_of(node, values)

    read, given = {}, {}
    for node in (node for node in known.node if node.op_type == "Conv"):
        source, weight = (makers.get(name) for name in node.input[:2])
        name = node.input[1] if weight is None else weight.input[0].removesuffix("_quantized")
        while source is not None and source.op_type in MOVES:
            source = makers.get(source.input[0])
        if weight is not None and source is not None and source.op_type == "DequantizeLinear":
            read[name] = step(source)
        if node.output[0] in quantisers:
            given[name] = step(quantisers[node.output[0]])
    return read, given


def _spread(graph: onnx.GraphProto, found: dict[str, Step]) -> bool:
    """Give what moves the steps of what it is moved from, and the other way round; tell whether any was new."""
    count = len(found)
    for node in graph.node:
        if node.op_type not in MOVES:
            continue
        moved = [*node.input[: None if node.op_type == "Concat" else 1], *node.output]
        step = next((found[name] for name in moved if name in found), None)
        if step is not None:
            found.update({name: step for name in moved if name not in found})
    return len(found) > count


def same_steps(one: onnx.NodeProto, other: onnx.NodeProto, values: dict[str, onnx.TensorProto]) -> bool:
    """Tell whether two nodes quantise or dequantise by the same steps; ``values`` are the constants of the graph."""
    return all(np.array_equal(a, b) for a, b in zip(_step_of(one, values), _step_of(other, values), strict=True))


def _step_of(node: onnx.NodeProto, values: dict[str, onnx.TensorProto]) -> Step:
    scale, zero = (numpy_helper.to_array(values[name]) for name in node.input[1:3])
    return scale, zero
