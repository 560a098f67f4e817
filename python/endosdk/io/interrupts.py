"""Ctrl-C and a polite kill: both heard as one, and made to wait until what must not be cut short is done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

STOPS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def kill_answered(answer: Callable[[int, Any], object]) -> Iterator[None]:
    """Let ``answer`` hear SIGTERM, the signal of ``kill``, systemd and ``docker stop``, which ends a process unheard.

    A host that answers the signal itself keeps its answer.
    """
    main = threading.current_thread() is threading.main_thread()  # only it may set signals
    if not main or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, answer)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Answer an interrupt that comes within the block at its end, as it would have been answered at once.

    Only the main thread hears signals; in any other there is nothing to do. A signal that Python does not answer, one
    that is ignored or that ends the process, is left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, Any]] = []
    before: dict[int, Any] = {}
    try:
        for number in STOPS:
            handler = signal.getsignal(number)
            if callable(handler):
                # First, so that an interrupt within `signal.signal` finds what to put back.
                before[number] = handler
                signal.signal(number, lambda *seen: came.append(seen))
        yield
    finally:
        for replaced, handler in before.items():
            signal.signal(replaced, handler)
    for first, frame in came[:1]:
        before[first](first, frame)
