"""Threads of Python where the system may have none left."""

from __future__ import annotations

import mmap
import threading

from endosdk.errors import OutOfMemory

NEEDED_BYTES = 12 << 20  # the stack that most systems give a thread, and what its first steps allocate


def start_thread(thread: threading.Thread) -> None:
    """Start a thread. Raises OutOfMemory where the system starts no further one, or has no memory for it."""
    try:
        # Python waits for ever for a thread that finds no memory in its first steps.
        mmap.mmap(-1, NEEDED_BYTES).close()
        thread.start()
    except (RuntimeError, OSError) as error:
        raise OutOfMemory("threads", "the system must be able to start 1 more", 0) from error
