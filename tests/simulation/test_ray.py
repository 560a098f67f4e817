"""A set rendered on a Ray cluster is the same set, even when a worker is killed on the way."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from endosdk.cli import main
from endosdk.dataset import verify_dataset
from endosdk.dataset_layouts import open_dataset

WORDS = (
    *("--organ", "stomach", "--seed", "3", "--width", "64", "--height", "48", "--focal", "27", "--max-disparity", "6"),
    *("--min-disparity", "0.2", "--pairs", "3"),
)


def parent(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])


def busy_workers() -> list[int]:
    """Processes that render for the cluster that this process started."""
    found = []
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            pid = int(line.parent.name)
            if line.read_bytes().startswith(b"ray::_work") and parent(parent(pid)) == os.getpid():
                found.append(pid)
    return found


def kill_a_worker(folder: Path, killed: list[int]) -> None:
    """Kill a worker that is rendering, once the first sample is there."""
    limit = time.monotonic() + 120
    while not killed and time.monotonic() < limit:
        if any(folder.glob("train/*")) and (pids := busy_workers()):
            os.kill(pids[0], signal.SIGKILL)
            killed.append(pids[0])
        time.sleep(0.01)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning", "ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_killed_worker_loses_nothing(renderer: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    ray = pytest.importorskip("ray")
    here, there = tmp_path / "here", tmp_path / "there"
    assert main(["simulate", "--out", str(here), *WORDS]) == 0
    killed: list[int] = []
    killer = threading.Thread(target=kill_a_worker, args=(there, killed), daemon=True)
    killer.start()
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        assert main(["simulate", "--out", str(there), "--ray", "--workers", "2", *WORDS]) == 0
    finally:
        ray.shutdown()
    killer.join()
    assert killed, "no worker was killed"
    assert open_dataset(there, "train").sha256 == open_dataset(here, "train").sha256
    assert all(fault is None for _, fault in verify_dataset(there))
