"""Ctrl-C that is heard whatever the program is doing, and a polite kill that is taken as one."""

from __future__ import annotations

import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from endosdk.io.interrupts import kill_answered

PAUSE = 0.05  # s; long enough for a finaliser to end


class Interrupts:
    """What came so far. ``status`` is the exit status of a program that it ended."""

    status = 128 + signal.SIGINT

    def terminated(self, number: int, _: object) -> None:
        """Interrupt the program, as the handler of a polite kill."""
        self.status = 128 + number
        raise KeyboardInterrupt


@contextmanager
def interrupts_heard() -> Iterator[Interrupts]:
    """Take SIGTERM as Ctrl-C, and hear both everywhere.

    An interrupt that came while a finaliser or a callback of C ran comes again: there Python reports
    ``KeyboardInterrupt`` as an exception that it ignores, and the program goes on.
    """
    interrupts = Interrupts()
    report = sys.unraisablehook

    def interrupt_again(ignored: Any) -> None:
        if not issubclass(ignored.exc_type, KeyboardInterrupt):
            report(ignored)
            return
        timer = threading.Timer(PAUSE, interrupt_main)
        timer.daemon = True
        timer.start()

    sys.unraisablehook = interrupt_again
    try:
        with kill_answered(interrupts.terminated):
            yield interrupts
    finally:
        sys.unraisablehook = report
