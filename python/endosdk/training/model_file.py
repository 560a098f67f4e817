"""Writing a model file so that no half of one is ever left behind."""

from __future__ import annotations

from pathlib import Path

import onnx

from endosdk.errors import StorageFailed


def write_model(model: onnx.ModelProto, path: Path) -> None:
    """Write the model as bytes that depend on nothing but itself; the folder is made. Raises StorageFailed."""
    partial = path.with_name(path.name + ".partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(model.SerializeToString(deterministic=True))
        partial.replace(path)
    except OSError as error:
        raise StorageFailed("path", "must be writable", f"{path} ({error.strerror})") from error
