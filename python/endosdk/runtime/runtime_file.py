"""The file that holds ONNX Runtime: where it is, its hash, and whether it is the one that was tested."""

from __future__ import annotations

import functools
import importlib.util
import re
from pathlib import Path

from endosdk.errors import InvalidArgument, RuntimeHashMismatch, RuntimeMissing
from endosdk.io.extras import must_install
from endosdk.io.file_hash import file_sha256

# In the packages from PyPI this one file is the runtime; the library for C beside it is not opened by Python.
PATTERN = "capi/onnxruntime_pybind11_state*"


def runtime_file() -> Path | None:
    """Return the file without importing anything of it; None where no runtime is installed."""
    spec = importlib.util.find_spec("onnxruntime")
    folders = spec.submodule_search_locations if spec is not None else None
    return next((file for folder in folders or () for file in sorted(Path(folder).glob(PATTERN))), None)


@functools.cache
def sha256_of(file: Path) -> str:
    """Return the hash of a file, taken once: what was loaded stays in memory, whatever becomes of the file."""
    return file_sha256(file)


def check_pin(expected: str) -> None:
    """Refuse a runtime whose file does not have this SHA-256, before anything of it runs."""
    if not isinstance(expected, str) or not re.fullmatch("[0-9a-fA-F]{64}", expected):
        raise InvalidArgument("runtime_sha256", "must be 64 hexadecimal digits", repr(expected))
    file = runtime_file()
    if file is None:
        raise RuntimeMissing("onnxruntime", must_install("cpu"), "none")
    if (seen := sha256_of(file)) != expected.lower():
        raise RuntimeHashMismatch("runtime", f"{file} must have SHA-256 {expected.lower()}", seen)
