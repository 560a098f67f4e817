import sys

import pytest

from endosdk import _core
from endosdk.jobs.machine import instructions, peak_memory_mb


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no getrusage")
def test_peak_memory_counts_what_a_process_has_had():
    before = peak_memory_mb()
    assert before is not None and 10 < before < 100_000
    block = bytearray(int(before * 2**20) + (200 << 20))  # more than ever before
    block[::4096] = b"x" * len(block[::4096])
    assert peak_memory_mb() > before + 150


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells its processor's instructions in /proc/cpuinfo")
def test_the_system_and_the_core_see_the_same_processor():
    """Two ways to ask: what the kernel lists, and what the processor answers when the core chooses its kernels."""
    assert ("avx2" in instructions()) == _core.has_integer_units()
