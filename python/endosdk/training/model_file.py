"""Writing a model file so that no half of one is ever left behind."""

from __future__ import annotations

from pathlib import Path

import onnx

from endosdk import _core
from endosdk.io.new_folders import made_folder
from endosdk.io.whole_files import whole_file


def properties_of(model: onnx.ModelProto) -> dict[str, str]:
    """Return the metadata of a model by its keys, ours and those of others."""
    return {entry.key: entry.value for entry in model.metadata_props}


def write_model(model: onnx.ModelProto, path: Path) -> None:
    """Write the model, sealed, as bytes that depend on nothing but itself; the folder is made. Raises StorageFailed."""
    made_folder(path.parent, "path")
    with whole_file(path) as stream:
        stream.write(sealed_bytes(model))


def sealed_bytes(model: onnx.ModelProto) -> bytes:
    """Return the bytes of a model with a hash of all of them inside."""
    sealed = onnx.ModelProto()
    sealed.CopyFrom(model)
    kept = [entry for entry in sealed.metadata_props if entry.key != _core.seal_key]
    del sealed.metadata_props[:]
    empty = onnx.StringStringEntryProto(key=_core.seal_key, value=_core.empty_seal)
    sealed.metadata_props.extend([*kept, empty])
    return _core.seal(sealed.SerializeToString(deterministic=True))
