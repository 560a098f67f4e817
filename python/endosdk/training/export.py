"""Export a trained network to the one file that is deployed."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import onnx
import torch

from endosdk import _core
from endosdk.errors import InvalidArgument
from endosdk.io.names import RULE, is_plain_name
from endosdk.training.model_file import write_model
from endosdk.training.networks.base import Deployed, StereoNetwork
from endosdk.training.outline import outline_functions

OPSET = 18  # the one that torch's exporter writes without conversion; every runtime we support reads it
TRACE_SIZE = (96, 160)  # height, width of the example input; the file accepts any multiple of input_multiple
MOST_STEPS = 2**12  # the exporter wants a limit on how many steps high and wide a frame may be


@dataclass(frozen=True)
class ModelDescription:
    """What a model file says about itself beside what the network knows."""

    name: str  # the name under which users load it
    version: str
    license: str = "Apache-2.0"
    intended_use: str = "Research and evaluation on rectified binocular endoscopy; not a medical device."
    training: dict[str, Any] = field(default_factory=dict)  # data ids and hashes, commit, recipe, test metrics

    def __post_init__(self) -> None:
        """Check what every reader of the file demands."""
        if not is_plain_name(self.name):
            raise InvalidArgument("name", RULE, repr(self.name))
        if not self.version:
            raise InvalidArgument("version", "must not be empty", repr(self.version))


def export_model(network: StereoNetwork, path: Path, info: ModelDescription, *, size_step: int = 1) -> None:
    """Write the network as one self-describing ONNX file, atomically.

    The same network gives the same bytes. Height and width stay free (multiples of ``input_multiple``), and so does
    the batch. ``size_step`` tells the exporter that both are multiples of it: it cannot follow a network that halves
    its input several times and joins the maps again otherwise; for other networks it only makes the trace slower.
    """
    deployed = Deployed(network.export_form()).eval()
    model = _to_onnx(deployed, size_step)
    _strip(model)
    outline_functions(model)
    _name_sizes(model, deployed.network.deployed_stride)
    onnx.helper.set_model_props(model, _metadata(deployed, info))
    onnx.checker.check_model(model, full_check=True)
    write_model(model, path)


def _to_onnx(deployed: Deployed, size_step: int) -> onnx.ModelProto:
    height, width = TRACE_SIZE
    example = torch.randint(
        0, 256, (2, 3, height, width), dtype=torch.uint8, generator=torch.Generator().manual_seed(0)
    )
    free: dict[int, Any] = {0: "batch", 2: "height", 3: "width"}
    if size_step > 1:
        free.update({axis: size_step * torch.export.Dim(free[axis], min=2, max=MOST_STEPS) for axis in (2, 3)})
    with _quiet_exporter():
        program = torch.onnx.export(
            deployed,
            (example, example.flip(3)),
            dynamo=True,
            external_data=False,
            opset_version=OPSET,
            input_names=["left", "right"],
            output_names=["disparity", "confidence"],
            dynamic_shapes={"left": free, "right": free},
            verbose=False,
        )
    if program is None:
        raise RuntimeError("the exporter returned no program")
    model: onnx.ModelProto = program.model_proto
    return model


@contextmanager
def _quiet_exporter() -> Iterator[None]:
    """Keep the exporter's own deprecations and log lines from the user, who can do nothing about them."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _strip(model: onnx.ModelProto) -> None:
    """Remove what the exporter notes about our source files, classes and shapes."""
    del model.metadata_props[:]
    model.ClearField("doc_string")
    graph = model.graph
    graph.name = "endosdk"
    graph.ClearField("doc_string")
    del graph.metadata_props[:]
    del graph.value_info[:]
    for item in (*graph.node, *graph.initializer, *graph.input, *graph.output):
        item.ClearField("doc_string")
        del item.metadata_props[:]


def _name_sizes(model: onnx.ModelProto, stride: int) -> None:
    """Say plainly how large inputs and outputs are; the exporter writes the arithmetic of its trace instead."""
    suffix = "" if stride == 1 else f"/{stride}"
    for values, end in ((model.graph.input, ""), (model.graph.output, suffix)):
        for value in values:
            for axis, size in ((0, "batch"), (2, "height" + end), (3, "width" + end)):
                value.type.tensor_type.shape.dim[axis].dim_param = size


def _metadata(deployed: Deployed, info: ModelDescription) -> dict[str, str]:
    network = deployed.network
    entries = {
        "format_version": _core.model_format_version,
        "name": info.name,
        "version": info.version,
        "input_multiple": str(network.input_multiple),
        "output_stride": str(network.deployed_stride),
        "max_disparity": str(network.max_disparity),
        "channel_order": "rgb",
        "license": info.license,
        "training": json.dumps(info.training, sort_keys=True, separators=(",", ":")),
        "intended_use": info.intended_use,
        "upsampling": _core.upsampling_metadata,  # what training/upsampling.py puts the network through
    }
    for key, value in (
        ("inference_width", network.inference_width),
        ("max_candidate_disparity", network.max_candidate_disparity),
    ):
        if value is not None:
            entries[key] = str(value)
    return {_core.model_key_prefix + key: value for key, value in entries.items()}
