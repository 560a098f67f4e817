import sys

import pytest

from endosdk import _core
from endosdk.jobs.machine import instructions


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells its processor's instructions in /proc/cpuinfo")
def test_the_system_and_the_core_see_the_same_processor():
    """Two ways to ask: what the kernel lists, and what the processor answers when the core chooses its kernels."""
    assert ("avx2" in instructions()) == _core.has_integer_units()
