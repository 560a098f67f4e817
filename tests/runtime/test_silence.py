"""No network and no file of its own: seen from outside, with a library that records every attempt."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT, TINY_MODEL

PREDICT = f"""
import time
import endosdk
from tests.conftest import shifted_pair
estimator = endosdk.DepthEstimator({str(TINY_MODEL)!r})
pair = shifted_pair(64, 96, 8)
for _ in range(200):
    estimator.predict(*pair)
time.sleep(3)  # the runtime's own reporter looks up its host within this time when it is on
"""

TALK = "import socket\ntry: socket.getaddrinfo('example.invalid', 80)\nexcept OSError: pass"


@pytest.fixture(scope="module")
def watcher(tmp_path_factory):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = tmp_path_factory.mktemp("watch") / "watch_network.so"
    source = ROOT / "tests" / "data" / "watch_network.c"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    return library


def attempts(watcher: Path, home: Path, program: str) -> list[str]:
    log = home.parent / f"{home.name}.log"
    # CI keeps the runtime's reporter off by itself, so the proof must run without that variable.
    environment = {k: v for k, v in os.environ.items() if k not in ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")}
    environment |= {
        "LD_PRELOAD": str(watcher),
        "WATCH_NETWORK_LOG": str(log),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "PYTHONPATH": str(ROOT),
    }
    subprocess.run([sys.executable, "-c", program], check=True, env=environment, cwd=ROOT)
    return log.read_text().splitlines() if log.exists() else []


def test_the_watcher_sees(watcher, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    assert "example.invalid" in attempts(watcher, home, TALK)


def test_two_hundred_frames_reach_nobody_and_leave_nothing(watcher, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    assert attempts(watcher, home, PREDICT) == []
    assert list(home.rglob("*")) == []
