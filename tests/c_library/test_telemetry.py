"""Telemetry of ONNX Runtime in a process of the C library: off, unless the host has opened the runtime with it on."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.metadata import version

import pytest

from tests.c_library import binding as c
from tests.conftest import ROOT

# What imports endosdk sets the switch for this process; a host in C does not. The reporter starts with the environment
# that the host makes.
HOST = """
import ctypes, json, os, sys, time
if sys.argv[1] == "runtime first":
    class Base(ctypes.Structure):
        _fields_ = [("get_api", ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint32)), ("version", ctypes.c_void_p)]
    runtime = ctypes.CDLL(sys.argv[2])
    runtime.OrtGetApiBase.restype = ctypes.POINTER(Base)
    functions = ctypes.cast(runtime.OrtGetApiBase().contents.get_api(20), ctypes.POINTER(ctypes.c_void_p))
    create_environment = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)(functions[3])
    environment = ctypes.c_void_p()
    assert create_environment(2, b"host", ctypes.byref(environment)) is None
before = os.environ.get("ORT_DISABLE_TELEMETRY")
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL, shifted_pair
os.environ.pop("ORT_DISABLE_TELEMETRY", None)
if before is not None:
    os.environ["ORT_DISABLE_TELEMETRY"] = before
lines = []
log = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int32, ctypes.c_char_p)(
    lambda _, level, line: lines.append((level, line.decode()))
)
estimator = c.CEstimator(
    c.load(sys.argv[3]), TINY_MODEL, log=ctypes.cast(log, ctypes.c_void_p), runtime_library=sys.argv[2].encode()
)
estimator.predict(*shifted_pair(64, 96, 8), maps=("disparity",))
time.sleep(float(sys.argv[4]))
print(json.dumps([lines, json.loads(estimator.diagnostics())["onnxruntime_telemetry"]]))
"""
WARNING = [2, "ONNX Runtime was opened by the host with its telemetry on; set ORT_DISABLE_TELEMETRY=1 first"]
SWITCHES = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")  # the first two keep the reporter off by themselves


def opened(installed, order, wait_s=0.0, **variables):
    """Lines of the log, and what the report says of telemetry, of a host that opens the two in this order."""
    environment = {name: value for name, value in os.environ.items() if name not in SWITCHES}
    command = [sys.executable, "-c", HOST, order, str(c.runtime_library()), str(installed.library), str(wait_s)]
    done = subprocess.run(
        command, env={**environment, **variables}, cwd=ROOT, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def test_a_host_that_opened_the_runtime_first_is_warned(installed):
    lines, stated = opened(installed, "runtime first")
    assert [line for line in lines if "telemetry" in line[1]] == [WARNING]
    assert stated == "on: loaded by the host first"


@pytest.mark.parametrize(
    ("order", "variables"),
    [("runtime first", {"ORT_DISABLE_TELEMETRY": "1"}), ("endosdk first", {})],
    ids=["switch set", "endosdk first"],
)
def test_telemetry_is_off_otherwise(installed, order, variables):
    lines, stated = opened(installed, order, **variables)
    assert not [line for line in lines if "telemetry" in line[1]]
    assert stated == "off"


def test_only_the_host_that_was_warned_is_heard(installed, watcher, tmp_path):
    """The reporter looks up its host about 9 s after the runtime was opened."""
    if tuple(int(part) for part in version("onnxruntime").split(".")[:2]) < (1, 29):
        pytest.skip("this release of ONNX Runtime has no reporter")
    heard = {}
    for order in ("runtime first", "endosdk first"):
        log = tmp_path / f"{order}.log"
        opened(installed, order, 20.0, LD_PRELOAD=str(watcher), WATCH_NETWORK_LOG=str(log))
        heard[order] = log.read_text() if log.exists() else ""
    assert "microsoft" in heard["runtime first"]
    assert heard["endosdk first"] == ""
