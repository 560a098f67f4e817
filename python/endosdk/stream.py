"""Several frames in flight, each on a thread of its own; their results in order."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

from endosdk import _core

Item = TypeVar("Item")
Ready = TypeVar("Ready")
Result = TypeVar("Result")

THREAD_NAME = "endosdk-stream"


class _End:
    """What a source gives when it has no more."""


_END = _End()


class InFlight(Generic[Item, Ready, Result]):
    """Takes items one after the other, computes up to ``lanes`` of them at a time, gives the results in order.

    ``take(number, item)`` is called in order and never twice at a time; the next item is drawn only when it is done, so
    a source may reuse its memory. ``compute(number, ready)`` gets what it returned and runs beside others. No more than
    ``lanes`` results are on their way or waiting: an item's number modulo ``lanes + 1`` names memory that no other item
    uses, the one whose result is in the consumer's hands included. An error is raised in its turn and ends the stream.
    """

    def __init__(
        self,
        items: Iterator[Item],
        lanes: int,
        take: Callable[[int, Item], Ready],
        compute: Callable[[int, Ready], Result],
    ) -> None:
        self._items = items
        self._lanes = lanes
        self._take = take
        self._compute = compute
        self._turn = threading.Condition()
        self._drawn = 0  # whose turn it is to draw
        self._over = False  # nothing is drawn any more

    def results(self) -> Iterator[Result]:
        """Yield the results; closing the iterator waits for what is in flight and ends the threads."""
        pool = ThreadPoolExecutor(self._lanes, THREAD_NAME, initializer=_core.stay_alone)
        numbers = itertools.count()
        coming: deque[Future[tuple[Result] | None]] = deque()
        try:
            for _ in range(self._lanes):
                coming.append(pool.submit(self._work, next(numbers)))
            while (done := coming.popleft().result()) is not None:
                coming.append(pool.submit(self._work, next(numbers)))
                yield done[0]
        finally:
            self._over = True
            pool.shutdown(wait=True, cancel_futures=True)

    def _work(self, number: int) -> tuple[Result] | None:
        """Draw and compute one item; None after the last."""
        with self._turn:
            # The pool starts work in the order of its numbers, so every earlier one is running or done.
            self._turn.wait_for(lambda: self._drawn == number)
            try:
                item = _END if self._over else next(self._items, _END)
                if isinstance(item, _End):
                    self._over = True
                    return None
                ready = self._take(number, item)
            except BaseException:
                self._over = True
                raise
            finally:
                self._drawn += 1
                self._turn.notify_all()
        return (self._compute(number, ready),)
