"""Ctrl-C that is heard whatever the program is doing."""

from __future__ import annotations

import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PAUSE = 0.05  # s; long enough for a finaliser to end


@contextmanager
def interrupts_heard() -> Iterator[None]:
    """Interrupt again after an interrupt that came while a finaliser or a callback of C ran.

    There Python reports ``KeyboardInterrupt`` as an exception that it ignores, and the program goes on.
    """
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
        yield
    finally:
        sys.unraisablehook = report
