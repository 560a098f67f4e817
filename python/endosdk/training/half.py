"""From an exported float model to one that computes in 16-bit floats, for graphics cards.

Inputs and outputs keep their types. What turns costs into disparity stays in 32 bits: the softmax, the sum over planes,
every logarithm and exponential of the confidence, and the enlargement of the answer.
"""

from __future__ import annotations

from pathlib import Path

import onnx
from onnxruntime.transformers.float16 import DEFAULT_OP_BLOCK_LIST, convert_float_to_float16
from onnxruntime.transformers.onnx_model import OnnxModel

from endosdk.errors import StorageFailed

EXACT = ["Softmax", "MatMul", "Log", "Exp", "Resize", "ReduceMax", "ReduceSum", "Clip", "MaxPool", "Cast"]


def half_model(source: Path, out: Path) -> None:
    """Write the 16-bit form of the float model ``source`` to ``out``."""
    model = onnx.load(source)
    properties = {entry.key: entry.value for entry in model.metadata_props}
    half = convert_float_to_float16(
        model, keep_io_types=True, op_block_list=[*DEFAULT_OP_BLOCK_LIST, *EXACT], disable_shape_infer=False
    )
    _drop_repeated(half.graph)
    OnnxModel(half).topological_sort()  # the conversion appends its casts at the end
    del half.metadata_props[:]
    onnx.helper.set_model_props(half, properties)
    onnx.checker.check_model(half)
    partial = out.with_name(out.name + ".partial")
    try:
        partial.write_bytes(half.SerializeToString(deterministic=True))
        partial.replace(out)
    except OSError as error:
        raise StorageFailed("out", "must be writable", f"{out} ({error.strerror})") from error


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
