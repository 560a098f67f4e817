"""Several frames in flight, each on a thread of its own; their results in order."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from endosdk import _core

Item = TypeVar("Item")
Ready = TypeVar("Ready")
Result = TypeVar("Result")

THREAD_NAME = "endosdk-stream"
SOURCE_PATIENCE_S = 0.2  # how long closing waits for a source that is asked for an item and does not answer


class _End:
    """What a source gives when it has no more."""


_END = _End()


@dataclass(frozen=True)
class _Outcome(Generic[Result]):
    """What became of one item: a result, an error, or neither at the end of the source."""

    result: Result | _End
    error: BaseException | None = None


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
        self._change = threading.Condition()  # guards everything below
        self._next = 0  # number of the item that is drawn next
        self._given = 0  # results handed out
        self._reader: threading.Thread | None = None  # the lane that draws or takes an item
        self._busy = 0  # lanes at work outside the source
        self._over = False  # nothing is drawn any more
        self._outcomes: dict[int, _Outcome[Result]] = {}

    def results(self) -> Iterator[Result]:
        """Yield the results.

        Closing the iterator waits for what is being computed and ends the threads. A lane that is held up in the
        source, in a camera that has stalled, is left behind: it ends when the source answers, and does not keep the
        program from ending.
        """
        lanes = [
            threading.Thread(target=self._serve, name=f"{THREAD_NAME}-{lane}", daemon=True)
            for lane in range(self._lanes)
        ]
        for lane in lanes:
            lane.start()
        try:
            for number in itertools.count():
                outcome = self._wait_for_outcome(number)
                if outcome.error is not None:
                    raise outcome.error
                if isinstance(outcome.result, _End):
                    return
                yield outcome.result
        finally:
            self._close(lanes)

    def _wait_for_outcome(self, number: int) -> _Outcome[Result]:
        with self._change:
            self._change.wait_for(lambda: number in self._outcomes)
            self._given += 1
            self._change.notify_all()
            return self._outcomes.pop(number)

    def _close(self, lanes: list[threading.Thread]) -> None:
        with self._change:
            self._over = True
            self._change.notify_all()
            self._change.wait_for(lambda: self._busy == 0)
            held_up = self._reader
        for lane in lanes:
            lane.join(SOURCE_PATIENCE_S if lane is held_up else None)

    def _serve(self) -> None:
        """Work on one item after the other, until the stream is over."""
        _core.set_threads(1)
        while (number := self._turn_to_draw()) is not None:
            outcome = self._work(number)
            with self._change:
                self._busy -= 1
                if outcome is not None:
                    self._outcomes[number] = outcome
                self._change.notify_all()

    def _turn_to_draw(self) -> int | None:
        """Wait until this lane may draw and return its item's number; None when nothing is drawn any more."""
        with self._change:
            self._change.wait_for(
                lambda: self._over or (self._reader is None and self._next < self._given + self._lanes)
            )
            if self._over:
                return None
            self._reader = threading.current_thread()
            self._next += 1
            return self._next - 1

    def _work(self, number: int) -> _Outcome[Result] | None:
        """Draw, take and compute one item; leaves the lane counted as busy. None when nobody waits for it any more."""
        try:
            try:
                item = next(self._items, _END)
            finally:
                with self._change:
                    self._busy += 1
            if self._over:
                return None
            if isinstance(item, _End):
                self._end()
                return _Outcome(_END)
            ready = self._take(number, item)
            with self._change:
                self._reader = None
                self._change.notify_all()
            return _Outcome(self._compute(number, ready))
        except BaseException as error:  # whatever it is, it is raised where the results are drawn
            self._end()
            return _Outcome(_END, error)

    def _end(self) -> None:
        with self._change:
            self._over = True
