"""Convert an exported float model to one that computes in 16-bit floats, for graphics cards.

Inputs and outputs keep their types. What turns costs into disparity stays in 32 bits: the softmax, the sum over planes,
every logarithm and exponential of the confidence, and the enlargement of the answer. So does all that looks into the
pictures at a fraction of a pixel: 16 bits know a column of 480 to a quarter.
"""

from __future__ import annotations

import onnx
from onnx import TensorProto
from onnxruntime.transformers.float16 import DEFAULT_OP_BLOCK_LIST, convert_float_to_float16
from onnxruntime.transformers.onnx_model import OnnxModel

from endosdk.training.model_file import properties_of
from endosdk.training.outline import inline_functions

EXACT = ["Softmax", "MatMul", "Log", "Exp", "Resize", "ReduceMax", "ReduceSum", "Clip", "MaxPool", "Cast"]


def halved(model: onnx.ModelProto) -> onnx.ModelProto:
    """Return the 16-bit form of a float model; the model given is used up."""
    model = inline_functions(model)
    properties = properties_of(model)
    half: onnx.ModelProto = convert_float_to_float16(
        model,
        keep_io_types=True,
        op_block_list=[*DEFAULT_OP_BLOCK_LIST, *EXACT],
        node_block_list=looking_nodes(model.graph),
        disable_shape_infer=False,
    )
    _drop_repeated(half.graph)
    OnnxModel(half).topological_sort()  # the conversion appends its casts at the end
    _drop_round_trips(half.graph)
    del half.graph.value_info[:]
    del half.metadata_props[:]
    onnx.helper.set_model_props(half, properties)
    onnx.checker.check_model(half)
    return half


def looking_nodes(graph: onnx.GraphProto) -> list[str]:
    """Name the nodes that say where to look into the pictures and what is there, up to the nearest convolutions."""
    makers = {name: node for node in graph.node for name in node.output}
    found = {node.name for node in graph.node if node.op_type == "GatherElements"}
    for node in reversed(graph.node):  # in the order of computation, so one pass either way is enough
        if node.name in found:
            found.update(makers[name].name for name in node.input if name in makers and makers[name].op_type != "Conv")
    for node in graph.node:
        if node.op_type != "Conv" and any(name in makers and makers[name].name in found for name in node.input):
            found.add(node.name)
    return [node.name for node in graph.node if node.name in found]


def _drop_round_trips(graph: onnx.GraphProto) -> None:
    """Let exact nodes hand their values on as they are: the conversion casts every one down and up again."""
    makers = {name: node for node in graph.node for name in node.output}
    whole: dict[str, str] = {}
    for node in graph.node:
        maker = makers.get(node.input[0]) if node.op_type == "Cast" else None
        if _casts_to(node, TensorProto.FLOAT) and maker is not None and _casts_to(maker, TensorProto.FLOAT16):
            whole[node.output[0]] = maker.input[0]
    for node in graph.node:
        for slot, name in enumerate(node.input):
            node.input[slot] = whole.get(name, name)
    kept: list[onnx.NodeProto] = []
    read = {value.name for value in graph.output}
    for node in reversed(graph.node):  # backwards: a cast that only dropped casts read is dropped too
        if node.op_type != "Cast" or node.output[0] in read:
            kept.append(node)
            read.update(node.input)
    del graph.node[:]
    graph.node.extend(reversed(kept))


def _casts_to(node: onnx.NodeProto, kind: int) -> bool:
    return node.op_type == "Cast" and node.attribute[0].i == kind


def _drop_repeated(graph: onnx.GraphProto) -> None:
    """Keep one of the equal casts that the conversion makes for a value that several exact nodes read."""
    seen: set[str] = set()
    kept = []
    for node in graph.node:
        if node.op_type == "Cast" and node.output[0] in seen:
            continue
        seen.update(node.output)
        kept.append(node)
    del graph.node[:]
    graph.node.extend(kept)
