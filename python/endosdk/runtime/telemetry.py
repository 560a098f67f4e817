"""Keep onnxruntime silent: its wheels from 1.29 on report usage to their maker unless that is off before they load."""

from __future__ import annotations

import os
import sys

VARIABLE = "ORT_DISABLE_TELEMETRY"

_loaded_before_us = False


def disable() -> None:
    """Set the switch for this process. It works only if onnxruntime has not been imported yet, which is recorded."""
    global _loaded_before_us
    if os.environ.get(VARIABLE) != "1" and "onnxruntime" in sys.modules:
        _loaded_before_us = True
    os.environ[VARIABLE] = "1"


def started_by_host() -> bool:
    """Whether onnxruntime was imported with telemetry on before endosdk could switch it off."""
    return _loaded_before_us
