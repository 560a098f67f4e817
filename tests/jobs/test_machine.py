import subprocess
import sys

import pytest

from endosdk import _core
from endosdk.jobs.machine import instructions


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no getrusage")
def test_peak_memory_counts_what_a_process_has_had():
    code = (
        "from endosdk.jobs.machine import peak_memory_mb as peak\n"
        "before = peak(); block = b'x' * (200 << 20); print(before, peak())"
    )
    block = b"x" * (400 << 20)  # what the parent has does not count
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    before, after = map(float, done.stdout.split())
    assert 10 < before < 300 < len(block) / 2**20
    assert before + 190 < after < before + 250


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells its processor's instructions in /proc/cpuinfo")
def test_the_system_and_the_core_see_the_same_processor():
    """Two ways to ask: what the kernel lists, and what the processor answers when the core chooses its kernels."""
    assert ("avx2" in instructions()) == _core.has_integer_units()
