"""Ten thousand frames in one process: memory, open files and threads are at the end what they were at the beginning."""

import json
import subprocess
import sys

from tests.conftest import ROOT

# In a process that does nothing else: what pytest keeps of a test would count.
PROGRAM = """
import json, os
from pathlib import Path
from endosdk import DepthEstimator
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

def use():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    counts = [len(os.listdir(f"/proc/self/{name}")) for name in ("fd", "task")]
    return [pages * os.sysconf("SC_PAGE_SIZE") / 2**20, *counts]

pair = shifted_pair(64, 96, 9)
with DepthEstimator(TINY_MODEL, threads=2, calibration=raw_rig().scaled(96, 64)) as estimator:
    first = estimator.predict(*pair).disparity.tobytes()
    for _ in range(500):
        estimator.predict(*pair)
    before = use()
    for _ in range(10_000):
        last = estimator.predict(*pair)
    after = use()
    same = last.disparity.tobytes() == first
    print(json.dumps([before, after, same, estimator.diagnostics()["frames"]]))
"""


def test_ten_thousand_frames_grow_nothing():
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, check=True, capture_output=True, text=True)
    before, after, same, frames = json.loads(done.stdout)
    assert same and frames == 10_501
    assert after[1:] == before[1:], "open files and threads"
    assert after[0] - before[0] < 1.0, "MB of memory"
