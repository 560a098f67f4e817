"""Memory that a training process frees is kept for its next step, and lies in large pages."""

import platform
import subprocess
import sys
from pathlib import Path

import pytest

# Page faults of four equal blocks in turn, in a process of its own: the setting cannot be taken back.
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
LARGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage/enabled")
has_glibc = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="sets the allocator of glibc")


def faults(how):
    found = subprocess.run([sys.executable, "-c", PROGRAM, how], check=True, capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


@has_glibc
def test_block_that_was_freed_is_handed_out_again_without_the_system():
    assert faults("kept")[-1] < 100 < 20_000 < faults("not")[-1]


@has_glibc
@pytest.mark.skipif(
    not LARGE_PAGES.exists() or "[never]" in LARGE_PAGES.read_text(), reason="this system gives no large pages"
)
def test_new_block_comes_in_large_pages():
    assert faults("kept")[0] < 5_000 < 20_000 < faults("not")[0]
