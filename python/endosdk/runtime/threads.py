"""Threads of Python where the system may have none left."""

from __future__ import annotations

import threading

from endosdk.errors import OutOfMemory


def start_thread(thread: threading.Thread) -> None:
    """Start a thread. Raises OutOfMemory where the system starts no further one."""
    try:
        thread.start()
    except RuntimeError as error:
        raise OutOfMemory("threads", "the system must be able to start 1 more", 0) from error
