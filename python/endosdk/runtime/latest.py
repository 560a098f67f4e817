"""One place between two threads, for the newest of what one of them has: what is not taken in time is dropped."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """One thread calls `put` and, at the end, `end`; another calls `take` and, where it goes before, `leave`.

    A thread that was left behind must not reach the next reader: each reading has one of its own.
    """

    def __init__(self) -> None:
        self.left = threading.Event()  # nobody takes any more
        self._change = threading.Condition()
        self._held: T | None = None
        self._over: BaseException | bool = False  # True at the end, or the error that ended it
        self._dropped = 0

    def put(self, item: T) -> None:
        """Offer an item; one that still waits is dropped."""
        with self._change:
            self._dropped += self._held is not None
            self._held = item
            self._change.notify()

    def end(self, over: BaseException | bool = True) -> None:
        """Say that nothing comes any more, or which error ended it."""
        with self._change:
            self._over = over
            self._change.notify()

    def leave(self) -> None:
        """Say that nobody takes any more; a `take` that waits ends."""
        self.left.set()
        with self._change:
            self._held = None
            self._over = True
            self._change.notify()

    def take(self) -> tuple[T, int] | None:
        """Wait for an item; return it and how many were dropped since the one before, or None at the end.

        Raises what ended it, after the last item.
        """
        with self._change:
            self._change.wait_for(lambda: self._held is not None or self._over)
            item, self._held = self._held, None
            dropped, self._dropped = self._dropped, 0
            if item is not None:
                return item, dropped
            if isinstance(self._over, BaseException):
                raise self._over
            return None
