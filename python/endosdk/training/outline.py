"""Functions of a model file: the operations between two marks, moved into a body of their own."""

from __future__ import annotations

import onnx
import onnx.inliner
from onnx import helper

from endosdk.training.networks.functions import MARKS

DOMAIN = "endosdk"
VERSION = 1


def outline_functions(model: onnx.ModelProto) -> None:
    """Replace the operations between each pair of marks (`Function`) by a call of a function, in place.

    A call's inputs are those of the mark, then the sizes that the operations take from elsewhere. Several calls of one
    function share its body.
    """
    graph = model.graph
    opsets = [entry for entry in model.opset_import if entry.domain != MARKS]
    bodies: dict[str, onnx.FunctionProto] = {}
    for end in [node for node in graph.node if _is_mark(node, "End")]:
        begin, body = _between_marks(graph, end)
        call, function = _call_and_function(graph, begin, body, end, opsets)
        if bodies.setdefault(function.name, function) != function:
            raise ValueError(f"{function.name} has two bodies")
        kept = [call if node == end else node for node in graph.node if node not in (begin, *body)]
        del graph.node[:]
        graph.node.extend(kept)
    if bodies:
        model.functions.extend(bodies.values())
        del model.opset_import[:]
        model.opset_import.extend([*opsets, helper.make_opsetid(DOMAIN, VERSION)])
        _drop_unused_constants(graph)
        _tell_ranks(model)


def inline_functions(model: onnx.ModelProto) -> onnx.ModelProto:
    """Return a model that computes the same without functions, for what does not look into them."""
    inlined: onnx.ModelProto = onnx.inliner.inline_local_functions(model)
    graph = inlined.graph
    nodes = []
    for node in graph.node:
        if node.op_type == "Constant":
            constant = onnx.TensorProto()
            constant.CopyFrom(node.attribute[0].t)
            constant.name = node.output[0]
            graph.initializer.append(constant)
        else:
            node.name = node.name or f"node_{node.output[0]}"
            nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)
    return inlined


def _is_mark(node: onnx.NodeProto, kind: str) -> bool:
    return bool(node.domain == MARKS and node.op_type == kind)


def _between_marks(graph: onnx.GraphProto, end: onnx.NodeProto) -> tuple[onnx.NodeProto, list[onnx.NodeProto]]:
    """Return the mark that an end belongs to, and the operations from there to the end in order of computation."""
    before = _ancestors(graph, end)
    begin = [node for node in before if _is_mark(node, "Begin") and _name(node) == _name(end)][-1]
    inside = set(begin.output)
    body = []
    for node in before[before.index(begin) + 1 :]:
        if inside.intersection(node.input):
            inside.update(node.output)
            body.append(node)
    return begin, body


def _ancestors(graph: onnx.GraphProto, last: onnx.NodeProto) -> list[onnx.NodeProto]:
    """Return what a node needs, in order of computation."""
    needed = set(last.input)
    found = []
    for node in reversed(graph.node):
        if needed.intersection(node.output):
            needed.update(node.input)
            found.append(node)
    return found[::-1]


def _call_and_function(
    graph: onnx.GraphProto,
    begin: onnx.NodeProto,
    body: list[onnx.NodeProto],
    end: onnx.NodeProto,
    opsets: list[onnx.OperatorSetIdProto],
) -> tuple[onnx.NodeProto, onnx.FunctionProto]:
    constants = {value.name: value for value in graph.initializer}
    inside = {name for node in (begin, *body) for name in node.output}
    used = list(dict.fromkeys(name for node in body for name in node.input if name and name not in inside))
    outside = [name for name in used if name not in constants]
    names = {name: f"input_{i}" for i, name in enumerate([*begin.output, *outside])}
    held = [constants[name] for name in used if name in constants]
    names |= {value.name: f"constant_{i}" for i, value in enumerate(held)}
    names |= {name: f"value_{i}" for i, name in enumerate(name for node in body for name in node.output)}
    nodes = [helper.make_node("Constant", [], [names[value.name]], value=_unnamed(value)) for value in held]
    for node in body:
        renamed = onnx.NodeProto()
        renamed.CopyFrom(node)
        renamed.ClearField("name")
        for values in (renamed.input, renamed.output):
            values[:] = [names.get(name, "") for name in values]
        nodes.append(renamed)
    settings = {entry.name: helper.get_attribute_value(entry) for entry in end.attribute if entry.name != "name"}
    function = helper.make_function(
        DOMAIN,
        _name(end),
        [names[name] for name in (*begin.output, *outside)],
        [names[name] for name in end.input],
        nodes,
        opsets,
        attributes=sorted(settings),
    )
    call = helper.make_node(
        _name(end), [*begin.input, *outside], list(end.output), name=f"node_{end.output[0]}", domain=DOMAIN, **settings
    )
    return call, function


def _name(mark: onnx.NodeProto) -> str:
    (name,) = (helper.get_attribute_value(entry) for entry in mark.attribute if entry.name == "name")
    return str(name.decode())


def _unnamed(value: onnx.TensorProto) -> onnx.TensorProto:
    tensor = onnx.TensorProto()
    tensor.CopyFrom(value)
    tensor.ClearField("name")
    return tensor


def _tell_ranks(model: onnx.ModelProto) -> None:
    """Say how many axes the results of calls have: who computes a function himself cannot infer that from its body."""
    results = {name for node in model.graph.node if node.domain == DOMAIN for name in node.output}
    inferred = onnx.shape_inference.infer_shapes(model).graph.value_info
    for value in (value for value in inferred if value.name in results):
        for side in value.type.tensor_type.shape.dim:
            side.ClearField("dim_param")
        model.graph.value_info.append(value)


def _drop_unused_constants(graph: onnx.GraphProto) -> None:
    used = {name for node in graph.node for name in node.input}
    kept = [value for value in graph.initializer if value.name in used]
    del graph.initializer[:]
    graph.initializer.extend(kept)
