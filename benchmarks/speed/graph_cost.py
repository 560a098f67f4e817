"""What one run of a model must compute and move, counted from the shapes that the runtime saw."""

from __future__ import annotations

import json
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort

# Bytes of one element, by the runtime's names of types.
ELEMENT = {"float": 4, "float16": 2, "uint8": 1, "int8": 1, "int32": 4, "int64": 8, "bool": 1}
CONVOLUTIONS = ("Conv", "QLinearConv", "ConvInteger")


@dataclass(frozen=True)
class GraphCost:
    """Multiplications with addition in convolutions; bytes that convolutions read and write, weights included."""

    macs: int
    conv_bytes: int

    def floors_ms(self, tera_operations: float, gigabytes: float, bytes_share: float) -> dict[str, float]:
        """Return the least time for the arithmetic and for the traffic, ms, on a device with these rates a second.

        ``bytes_share`` scales the bytes of the counted form to those of the timed one: 0.5 for half precision.
        """
        return {
            "arithmetic": 2e3 * self.macs / (1e12 * tera_operations),
            "traffic": 1e3 * self.conv_bytes * bytes_share / (1e9 * gigabytes),
        }


def graph_cost(model: bytes, width: int, height: int) -> GraphCost:
    """Count by running the model once on the processor, nothing fused, with the runtime's profile on."""
    with tempfile.TemporaryDirectory() as folder:
        options = ort.SessionOptions()
        options.log_severity_level = 3
        options.enable_profiling = True
        options.profile_file_prefix = str(Path(folder) / "profile")
        options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
        session = ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        view = np.zeros((1, 3, height, width), np.uint8)
        session.run(None, {"left": view, "right": view})
        events = json.loads(Path(session.end_profiling()).read_text())
    convolutions = [
        event["args"]
        for event in events
        if event["name"].endswith("_kernel_time") and event["args"]["op_name"] in CONVOLUTIONS
    ]
    return GraphCost(sum(map(_macs, convolutions)), sum(map(_bytes, convolutions)))


def _macs(node: dict[str, Any]) -> int:
    shapes = [next(iter(entry.values())) for entry in node["input_type_shape"]]
    weights = max((shape for shape in shapes[1:] if len(shape) == 4), key=math.prod)
    result = next(iter(node["output_type_shape"][0].values()))
    return math.prod(result) * math.prod(weights[1:])


def _bytes(node: dict[str, Any]) -> int:
    entries = [*node["input_type_shape"], *node["output_type_shape"]]
    return sum(ELEMENT[kind] * math.prod(shape) for entry in entries for kind, shape in entry.items())
