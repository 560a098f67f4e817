"""A set rendered on a Ray cluster is the same set, even when a worker is killed on the way."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import pytest

from endosdk.cli import main
from endosdk.dataset import open_dataset, verify_dataset

WORDS = (
    *("--organ", "ducts", "--seed", "3", "--width", "64", "--height", "48", "--focal", "27", "--max-disparity", "6"),
    *("--min-disparity", "0.2", "--pairs", "3"),
)


def kill_a_worker(folder: Path, killed: list[int]) -> None:
    """Kill the first process that is seen writing a sample."""
    limit = time.monotonic() + 120
    while not killed and time.monotonic() < limit:
        for partial in folder.glob(".partial-train-*"):
            pid = int(partial.name.rsplit("-", 1)[1])
            if pid != os.getpid():
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
                return
        time.sleep(0.001)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning", "ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_killed_worker_loses_nothing(renderer: object, tmp_path: Path) -> None:
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
