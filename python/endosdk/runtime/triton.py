"""A model as a repository that NVIDIA's Triton server reads: the network alone, served to many clients.

Clients rectify, resize to the model's width and pad to its multiple themselves, as the parameters of the configuration
say, and make maps of the answer; `DepthEstimator` does the same in one process.
"""

from __future__ import annotations

from pathlib import Path

from endosdk import _core
from endosdk.errors import InvalidArgument
from endosdk.io.names import RULE, is_plain_name
from endosdk.io.new_folders import made_folder
from endosdk.io.whole_files import whole_file, write_text
from endosdk.runtime.models import ModelInfo, read_model
from endosdk.runtime.session import StereoSession

Shape = list[int | str | None]


def write_repository(model: str | Path, folder: str | Path) -> Path:
    """Add a model, by shipped name or path, to the repository ``folder`` and return the file of its configuration.

    Writes ``NAME/config.pbtxt`` and ``NAME/VERSION/model.onnx``, the very bytes of the model. Raises InvalidArgument
    where the model's version is no number of Triton's, what `read_model` and `StereoSession` raise, and StorageFailed.
    """
    file = read_model(model)
    session = StereoSession(file, threads=1)
    info = session.info
    if not (info.version.isascii() and info.version.isdecimal()) or int(info.version) < 1:
        raise InvalidArgument("model", "must have a whole number as its version, as Triton wants", repr(info.version))
    if not is_plain_name(info.name):  # it becomes a folder's
        raise InvalidArgument("model", f"its name {RULE}", repr(info.name))
    home = Path(folder) / info.name
    with whole_file(made_folder(home / info.version, "triton") / "model.onnx", "triton") as stream:
        stream.write(file.data)
    write_text(home / "config.pbtxt", _configuration(session, info), "triton")
    return home / "config.pbtxt"


def _configuration(session: StereoSession, info: ModelInfo) -> str:
    inputs = [_tensor("input", name, "TYPE_UINT8", shape) for name, shape in session.input_shapes.items()]
    outputs = [_tensor("output", name, "TYPE_FP32", shape) for name, shape in session.output_shapes.items()]
    facts = {
        "sha256": info.sha256,
        "license": info.license,
        "channel_order": info.channel_order,
        "input_multiple": info.input_multiple,
        "output_stride": info.output_stride,
        "inference_width": info.inference_width,
        "max_candidate_disparity": info.max_candidate_disparity,
    }
    parameters = [
        f'parameters {{ key: "{_core.model_key_prefix}{key}" value {{ string_value: {_quoted(str(value))} }} }}'
        for key, value in facts.items()
        if value is not None
    ]
    head = [f"name: {_quoted(info.name)}", 'backend: "onnxruntime"', "max_batch_size: 0"]
    return "\n".join([*head, *inputs, *outputs, *parameters]) + "\n"


def _tensor(kind: str, name: str, data_type: str, shape: Shape) -> str:
    dims = ", ".join(str(side) if isinstance(side, int) else "-1" for side in shape)
    return f"{kind} {{ name: {_quoted(name)} data_type: {data_type} dims: [ {dims} ] }}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
