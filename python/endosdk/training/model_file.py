"""Writing a model file so that no half of one is ever left behind."""

from __future__ import annotations

from pathlib import Path

import onnx

from endosdk.errors import StorageFailed
from endosdk.io.whole_files import whole_file


def write_model(model: onnx.ModelProto, path: Path) -> None:
    """Write the model as bytes that depend on nothing but itself; the folder is made. Raises StorageFailed."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed("path", "must be writable", f"{path} ({error.strerror})") from error
    with whole_file(path) as stream:
        stream.write(model.SerializeToString(deterministic=True))
