"""Memory that a training process frees is kept for its next step."""

import platform
import subprocess
import sys

import pytest

# Page faults of the fourth of four equal blocks, in a process of its own: the setting cannot be taken back.
PROGRAM = """
import resource, sys
from endosdk.training.memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
for _ in range(4):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    block = bytearray(2**27)
    del block
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how):
    found = subprocess.run([sys.executable, "-c", PROGRAM, how], check=True, capture_output=True, text=True)
    return int(found.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="sets the allocator of glibc, which only Linux has")
def test_block_that_was_freed_is_handed_out_again_without_the_system():
    assert faults("kept") < 100 < 20_000 < faults("not")
