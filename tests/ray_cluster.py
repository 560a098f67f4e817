"""A Ray cluster for tests, and the death of one of its workers, as of a machine that fails."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


def ray_quiet(test: Callable[..., None]) -> Callable[..., None]:
    """Overlook what Ray itself warns of and leaves behind."""
    for warning in (
        "DeprecationWarning",
        "FutureWarning",
        "ResourceWarning",
        "pytest.PytestUnraisableExceptionWarning",
    ):
        test = pytest.mark.filterwarnings(f"ignore::{warning}")(test)
    return test


@contextlib.contextmanager
def ray_cluster() -> Iterator[None]:
    """A cluster of two workers on this machine."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray = pytest.importorskip("ray", reason="no Ray: pip install 'endosdk[ray]'")
    for last in (False, False, True):
        try:
            ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
            break
        except Exception as error:  # Ray has no type of its own for it
            # Ray waits half a minute for its parts, which a busy machine may not start in that time.
            if last or "timed out during startup" not in str(error):
                raise
            ray.shutdown()
    try:
        yield
    finally:
        ray.shutdown()


def parent(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])


def busy_workers() -> list[int]:
    """Processes that work for the cluster that this process started."""
    found = []
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            pid = int(line.parent.name)
            if line.read_bytes().startswith(b"ray::_work") and parent(parent(pid)) == os.getpid():
                found.append(pid)
    return found


@contextlib.contextmanager
def a_worker_killed(folder: Path, begun: str) -> Iterator[None]:
    """Kill a worker once ``folder`` holds something that matches ``begun``; fail where none was killed."""
    killed: list[int] = []

    def kill() -> None:
        limit = time.monotonic() + 120
        while not killed and time.monotonic() < limit:
            if any(folder.glob(begun)) and (pids := busy_workers()):
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])
            time.sleep(0.01)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    yield
    killer.join()
    assert killed, "no worker was killed"
