"""No network and no file of its own: seen from outside, with a library that records every attempt."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

from tests.conftest import ROOT, TINY_MODEL

PREDICT = f"""
import sys, time
import endosdk
from tests.conftest import shifted_pair
estimator = endosdk.DepthEstimator({str(TINY_MODEL)!r})
pair = shifted_pair(64, 96, 8)
for _ in range(1000):
    estimator.predict(*pair)
time.sleep(float(sys.argv[1]))
"""

# The runtime's own reporter looks up its host about 9 s after the import when it is on.
LONG_ENOUGH_S = 20

TALK = "import socket\ntry: socket.getaddrinfo('example.invalid', 80)\nexcept OSError: pass"


def attempts(watcher: Path, home: Path, program: str, *words: str, **variables: str) -> list[str]:
    log = home.parent / f"{home.name}.log"
    # CI keeps the runtime's reporter off by itself, so the proof must run without that variable.
    environment = {k: v for k, v in os.environ.items() if k not in ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")}
    environment |= {
        "LD_PRELOAD": str(watcher),
        "WATCH_NETWORK_LOG": str(log),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "PYTHONPATH": str(ROOT),
        **variables,
    }
    subprocess.run([sys.executable, "-W", "ignore", "-c", program, *words], check=True, env=environment, cwd=ROOT)
    return log.read_text().splitlines() if log.exists() else []


def test_the_watcher_sees(watcher, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    assert "example.invalid" in attempts(watcher, home, TALK)


def test_a_thousand_frames_reach_nobody_and_leave_nothing(watcher, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    assert attempts(watcher, home, PREDICT, "3") == []
    assert list(home.rglob("*")) == []


def test_only_a_host_that_imports_the_runtime_first_and_sets_no_switch_is_heard(watcher, tmp_path):
    def heard(host: str) -> list[str]:
        home = tmp_path / host
        home.mkdir()
        program = ("import onnxruntime\n" if host.startswith("runtime") else "") + PREDICT
        variables = {"ORT_DISABLE_TELEMETRY": "1"} if host.endswith("set") else {}
        return attempts(watcher, home, program, str(LONG_ENOUGH_S), **variables)

    hosts = ["endosdk first", "runtime first", "runtime first, switch set"]
    with ThreadPoolExecutor() as together:  # each of them mostly waits
        said = dict(zip(hosts, together.map(heard, hosts), strict=True))
    reports = tuple(int(part) for part in version("onnxruntime").split(".")[:2]) >= (1, 29)
    if reports:
        assert any("microsoft" in name for name in said.pop("runtime first")), "the wait is too short to prove anything"
    assert not any(said.values())
