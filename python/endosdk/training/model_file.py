"""Writing a model file so that no half of one is ever left behind."""

from __future__ import annotations

from pathlib import Path

import onnx

from endosdk.errors import StorageFailed
from endosdk.io.whole_files import whole_file
from endosdk.runtime.seal import EMPTY, KEY, seal


def write_model(model: onnx.ModelProto, path: Path) -> None:
    """Write the model, sealed, as bytes that depend on nothing but itself; the folder is made. Raises StorageFailed."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed("path", "must be writable", f"{path} ({error.strerror})") from error
    with whole_file(path) as stream:
        stream.write(sealed_bytes(model))


def sealed_bytes(model: onnx.ModelProto) -> bytes:
    """Return the bytes of a model with a hash of all of them inside; see `endosdk.runtime.seal`."""
    sealed = onnx.ModelProto()
    sealed.CopyFrom(model)
    kept = [entry for entry in sealed.metadata_props if entry.key != KEY]
    del sealed.metadata_props[:]
    sealed.metadata_props.extend([*kept, onnx.StringStringEntryProto(key=KEY, value=EMPTY)])
    return seal(sealed.SerializeToString(deterministic=True))
