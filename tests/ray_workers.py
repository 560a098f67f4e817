"""Kill a process that works for a Ray cluster, as a machine that fails would."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path


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
