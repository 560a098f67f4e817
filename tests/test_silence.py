"""No socket, and no file outside the folder that was given: proved in a process that forbids both."""

import os
import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT, TINY_MODEL

PROGRAM = f"""
import sys
seen = []
def watch(event, args):
    if event.startswith("socket."):
        seen.append((event, args))
sys.addaudithook(watch)
import time
import endosdk, numpy as np
estimator = endosdk.DepthEstimator({str(TINY_MODEL)!r})
frame = np.random.default_rng(0).integers(0, 255, (64, 96, 3)).astype(np.uint8)
for _ in range(50):
    estimator.predict(frame, frame)
time.sleep(3)  # the runtime's reporter, were it on, would look up its host within this time
threads = [open(f"/proc/self/task/{{t}}/comm").read().strip() for t in __import__("os").listdir("/proc/self/task")]
sockets = [l for l in (__import__("os").readlink(f"/proc/self/fd/{{f}}") for f in __import__("os").listdir("/proc/self/fd")
           if __import__("os").path.exists(f"/proc/self/fd/{{f}}")) if l.startswith("socket:")]
print("python sockets:", seen)
print("open sockets:", sockets)
"""


def test_a_thousand_words_to_nobody(tmp_path):
    # CI keeps the runtime's telemetry off by itself, so the proof must run without that variable.
    environment = {k: v for k, v in os.environ.items() if k not in ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")}
    environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, env=environment, cwd=ROOT
    )
    assert "python sockets: []" in done.stdout
    assert "open sockets: []" in done.stdout
    assert list(Path(tmp_path).rglob("*")) == []
