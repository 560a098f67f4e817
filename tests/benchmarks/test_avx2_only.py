"""A process whose libraries are told of no AVX-512: dispatch takes the AVX2 way, and the answer stays right."""

import shutil
import subprocess

import pytest

from benchmarks.speed.avx2_only import LIBRARIES, cpuid_offsets, library_file, measured, summary, without_avx512
from endosdk.jobs.machine import instructions

CLOSE = 1e-3  # of the error: both ways add the same 8-bit numbers, and round floats in another order


class Settings:
    threads, frames, size = 1, 25, "480x360"


def can_debug():
    """Say whether there is a debugger, and whether the system lets it run a process."""
    if any(shutil.which(tool) is None for tool in ("gdb", "objdump")):
        return False
    command = ["gdb", "-nx", "-batch", "-ex", "run", "-ex", "print $_exitcode", "--args", "true"]
    return "= 0" in subprocess.run(command, capture_output=True, text=True, check=False).stdout


@pytest.fixture(scope="module")
def offsets():
    if "avx512f" not in instructions():
        pytest.skip("needs a processor with AVX-512")
    if not can_debug():
        pytest.skip("needs gdb, objdump, and leave to debug")
    files = [library_file(module) for module in LIBRARIES]
    return {file.name: cpuid_offsets(file) for file in files}


@pytest.mark.slow
def test_libraries_ask_the_processor(offsets):
    assert all(offsets.values())


@pytest.mark.slow
def test_kernels_of_avx2_give_the_same_error(offsets):
    hidden, plain = measured("fast", Settings, offsets), measured("fast", Settings, None)
    assert (hidden["machine"]["kernels"], plain["machine"]["kernels"]) == ("avx2", "avx512")
    assert hidden["epe_px"] == pytest.approx(plain["epe_px"], rel=CLOSE)


@pytest.mark.slow
def test_a_command_that_fails_is_no_measurement(offsets):
    with pytest.raises(RuntimeError, match="ended with 3"):
        without_avx512(["-c", "raise SystemExit(3)"], offsets)
    with pytest.raises(RuntimeError, match="never asked"):
        without_avx512(["-c", "pass"], offsets)


def test_runs_with_unlike_answers_are_refused():
    run = {"machine": {"kernels": "avx2"}, "epe_px": 0.2, "size": [960, 720], "fps": 1.0, "stream_fps": 1.0}
    run["latency_ms"] = {"p50": 1.0, "p99": 2.0}
    assert summary([run, {**run, "fps": 3.0}])["fps"] == 2.0
    with pytest.raises(RuntimeError, match="unlike"):
        summary([run, {**run, "epe_px": 0.3}])
