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
# Elsewhere all memory comes in large pages, or none does.
on_request = pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc" or not LARGE_PAGES.exists() or "[madvise]" not in LARGE_PAGES.read_text(),
    reason="needs glibc, and a system that gives large pages on request",
)


def faults(how):
    found = subprocess.run([sys.executable, "-c", PROGRAM, how], check=True, capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


@on_request
def test_block_that_was_freed_is_handed_out_again_without_the_system():
    assert faults("kept")[-1] < 100 < 20_000 < faults("not")[-1]


# MiB of addresses for which this process has asked for large pages. Whether it gets them depends on what is free.
ASKED = """
import re
from endosdk.training.memory import keep_freed_memory
keep_freed_memory()
maps = open("/proc/self/smaps").read().split("VmFlags:")
sizes = [int(re.findall(r"^Size: +(\\d+) kB", one, re.MULTILINE)[-1]) for one in maps[:-1]]
print(sum(size for size, flags in zip(sizes, maps[1:]) if " hg" in flags.splitlines()[0]) // 1024)
"""


@on_request
def test_the_heap_is_to_grow_in_large_pages():
    found = subprocess.run([sys.executable, "-c", ASKED], check=True, capture_output=True, text=True)
    assert int(found.stdout) > 1024
