"""Functions of an 8-bit file that take and give bytes, where the quantiser leaves floats between two layers."""

from __future__ import annotations

import onnx
from onnx import helper

from endosdk.training.outline import DOMAIN
from endosdk.training.ranges import OVER_BYTES, VOLUME, same_steps

BYTES = "Bytes"  # ends the name of a function that takes and gives bytes
LAYOUTS = ("Transpose", "Reshape")


def compute_with_bytes(model: onnx.ModelProto) -> None:
    """Let the volume be made of bytes, and let what only moves values move bytes, in place."""
    for volume in [node for node in model.graph.node if node.op_type == VOLUME]:
        _make_of_bytes(model, volume)
    _move_bytes(model)
    _name_functions_of_bytes(model)


def _make_of_bytes(model: onnx.ModelProto, volume: onnx.NodeProto) -> None:
    """Let a volume read the bytes of the features and give bytes, with the steps by which these are read afterwards."""
    graph = model.graph
    makers, users = _makers(graph), users_of(graph)
    after = users[volume.output[0]][0]
    while after.op_type in (*LAYOUTS, OVER_BYTES):
        after = users[after.output[0]][0]
    features = [_dequantiser(name, makers) for name in volume.input[:2]]
    if after.op_type != "QuantizeLinear" or None in features:
        return  # of a network that is too thin for 8 bits there
    steps = [name for node in features if node is not None for name in node.input[1:3]]
    for place, node in enumerate(features):
        assert node is not None
        volume.input[place] = _take_bytes(graph, volume.input[place], node, makers)
    own, other, *sizes = volume.input
    values = volume.output[0]
    bytes_given = f"{values}_bytes"
    volume.op_type += BYTES
    volume.input[:] = [own, *steps[:2], other, *steps[2:], *after.input[1:3], *sizes]
    volume.output[0] = bytes_given
    graph.value_info.append(helper.make_tensor_value_info(bytes_given, onnx.TensorProto.UINT8, [None] * 5))
    dequantise = helper.make_node(
        "DequantizeLinear", [bytes_given, *after.input[1:3]], [values], name=f"{values}_floats"
    )
    graph.node.insert(list(graph.node).index(volume) + 1, dequantise)
    left = users_of(graph)
    kept = [node for node in graph.node if node not in features or node.output[0] in left]
    del graph.node[:]
    graph.node.extend(kept)


def _dequantiser(name: str, makers: dict[str, onnx.NodeProto]) -> onnx.NodeProto | None:
    """Return the node that makes floats of bytes, of which a value is only another layout."""
    node = makers.get(name)
    while node is not None and node.op_type in LAYOUTS:
        node = makers.get(node.input[0])
    return node if node is not None and node.op_type == "DequantizeLinear" else None


def _take_bytes(
    graph: onnx.GraphProto, name: str, dequantise: onnx.NodeProto, makers: dict[str, onnx.NodeProto]
) -> str:
    """Let what lays a value out anew take the bytes before a node; return the name of the bytes."""
    if name == dequantise.output[0]:
        return str(dequantise.input[0])
    moved = set()
    node = makers[name]
    while True:
        moved.add(node.output[0])
        if node.input[0] == dequantise.output[0]:
            break
        node = makers[node.input[0]]
    node.input[0] = dequantise.input[0]
    _tell_bytes(graph, moved)
    return name


def _move_bytes(model: onnx.ModelProto) -> None:
    """Let what only moves values move bytes, in place, where they have the same steps before and after."""
    graph = model.graph
    values = {value.name: value for value in graph.initializer}
    for quantise in [node for node in graph.node if node.op_type == "QuantizeLinear"]:
        makers, users = _makers(graph), users_of(graph)
        moves: list[onnx.NodeProto] = []
        node = makers.get(quantise.input[0])
        while node is not None and node.op_type in (*LAYOUTS, OVER_BYTES, OVER_BYTES + BYTES):
            moves.append(node)
            node = makers.get(node.input[0])
        # Reshapes alone are left to runtimes, which see through them.
        if node is None or node.op_type != "DequantizeLinear" or not any(move.op_type != "Reshape" for move in moves):
            continue
        if not same_steps(node, quantise, values) or any(len(users[move.output[0]]) > 1 for move in moves):
            continue
        _rewire(graph, node, moves, quantise, users)


def _rewire(
    graph: onnx.GraphProto,
    dequantise: onnx.NodeProto,
    moves: list[onnx.NodeProto],
    quantise: onnx.NodeProto,
    users: dict[str, list[onnx.NodeProto]],
) -> None:
    """Let moves, last one first, take the bytes before one node and give those after the other."""
    moves[-1].input[0] = dequantise.input[0]
    for move in moves:
        if move.op_type == OVER_BYTES:
            move.op_type += BYTES
    _tell_bytes(graph, {move.output[0] for move in moves})
    for user in users[quantise.output[0]]:
        user.input[:] = [moves[0].output[0] if name == quantise.output[0] else name for name in user.input]
    removed = [quantise, *([dequantise] if len(users[dequantise.output[0]]) == 1 else [])]
    kept = [each for each in graph.node if each not in removed]
    del graph.node[:]
    graph.node.extend(kept)


def _name_functions_of_bytes(model: onnx.ModelProto) -> None:
    """Add the functions of bytes, and remove those of floats that nothing calls."""
    called = {node.op_type for node in model.graph.node}
    functions = []
    for function in model.functions:
        if function.name in called:
            functions.append(function)
        if function.name + BYTES in called:
            functions.append(_between_bytes(function) if function.name == VOLUME else _renamed(function))
    del model.functions[:]
    model.functions.extend(functions)


def _renamed(function: onnx.FunctionProto) -> onnx.FunctionProto:
    """Return a function for bytes with the same body: it only moves them."""
    named = onnx.FunctionProto()
    named.CopyFrom(function)
    named.name += BYTES
    return named


def _between_bytes(function: onnx.FunctionProto) -> onnx.FunctionProto:
    """Return the function that makes floats of the bytes of two values, computes with them, and gives bytes."""
    own, other, *sizes = function.input
    inputs, nodes = [], []
    for name in (own, other):
        read = [f"{name}_bytes", f"{name}_scale", f"{name}_zero"]
        inputs += read
        nodes.append(helper.make_node("DequantizeLinear", read, [name]))
    (values,) = function.output
    step = [f"{values}_scale", f"{values}_zero"]
    given = f"{values}_bytes"
    nodes += [*function.node, helper.make_node("QuantizeLinear", [values, *step], [given])]
    return helper.make_function(
        DOMAIN,
        function.name + BYTES,
        [*inputs, *step, *sizes],
        [given],
        nodes,
        function.opset_import,
        attributes=list(function.attribute),
    )


def _tell_bytes(graph: onnx.GraphProto, names: set[str]) -> None:
    """Say of values that they are bytes now."""
    for value in graph.value_info:
        if value.name in names:
            value.type.tensor_type.elem_type = onnx.TensorProto.UINT8


def _makers(graph: onnx.GraphProto) -> dict[str, onnx.NodeProto]:
    return {name: node for node in graph.node for name in node.output}


def users_of(graph: onnx.GraphProto) -> dict[str, list[onnx.NodeProto]]:
    """Return the nodes that read each value."""
    users: dict[str, list[onnx.NodeProto]] = {}
    for node in graph.node:
        for name in node.input:
            users.setdefault(name, []).append(node)
    return users
