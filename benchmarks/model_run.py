"""Which file of a model runs on this processor."""

from __future__ import annotations

from pathlib import Path

from endosdk import _core
from endosdk.runtime.models import ModelFile, read_model


def model_run(source: str | Path) -> ModelFile:
    """Return the file that an estimator takes: where 8-bit integers are not fast, a shipped model has another one."""
    return read_model(source, integer_units=not _core.wants_float32_model("cpu"))
