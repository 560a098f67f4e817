"""A source of pairs tied to a compiled stream: pairs are drawn on a thread of their own, answers come in order."""

from __future__ import annotations

import atexit
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from endosdk import _core
from endosdk.errors import InvalidArgument, typed_memory_errors
from endosdk.runtime.drawn import SOURCE_PATIENCE_S, Drawn, checked
from endosdk.runtime.maps import Maps
from endosdk.runtime.newest_pairs import NewestPairs
from endosdk.runtime.threads import start_thread

THREAD_NAME = "endosdk-stream"

_open_streams: weakref.WeakSet[Feeder] = weakref.WeakSet()


class Feeder:
    """Draws pairs from a source, submits them to a stream, and gives the answers in order.

    The stream is opened for the size of the first pair. A pair is drawn when there is room for it, so that no more
    frames are on their way or waiting than the stream has lanes. With ``newest`` it is then the newest one that the
    source has; others are dropped.
    """

    def __init__(
        self,
        pairs: Iterator[Any],
        open_stream: Callable[[int, int], _core.Stream],
        maps_for: Callable[[int, _core.Stream, tuple[int, int]], Maps],
        channel_order: str,
        *,
        newest: bool,
    ) -> None:
        drawn = (checked(item, channel_order) for item in pairs)
        self._newest = NewestPairs(drawn) if newest else None
        self._pairs: Iterator[Drawn] = self._newest or drawn
        self._open_stream = open_stream
        self._maps_for = maps_for
        self._size = (0, 0)  # of the first pair
        self._stream: _core.Stream | None = None
        self._started = threading.Event()  # the stream is open, or never will be
        self._error: BaseException | None = None  # of the source, raised after the answers before it
        self._sources: deque[tuple[Any, int]] = deque()  # frame and dropped of the pairs that are on their way
        self._over = False
        self._exhausted = False  # the source has no further pair
        self._drawing = False
        self._reader = threading.Thread(target=self._read, name=THREAD_NAME, daemon=True)

    def answers(self) -> Iterator[tuple[_core.FrameReport, Maps, Any, int]]:
        """Yield what is said of each frame, its maps, and `frame` and `dropped` of its pair.

        Closing the iterator waits for what is being computed and ends the threads. A source that is held up, a camera
        that has stalled, is left behind: its thread ends when it answers, and does not keep the program from ending.
        """
        start_thread(self._reader)
        _open_streams.add(self)
        try:
            self._started.wait()
            while (answer := self._receive()) is not None:
                yield *answer, *self._sources.popleft()
            if self._error is not None:
                raise self._error
            if not self._exhausted:
                raise _closed_estimator()  # its reader may still wait for the source
        finally:
            self.close()

    @typed_memory_errors()
    def _receive(self) -> tuple[_core.FrameReport, Maps] | None:
        return None if self._stream is None else self._stream.receive()

    def close(self) -> None:
        """End the stream."""
        self._over = True
        if self._newest is not None:
            self._newest.close()
        opened = self._stream
        if opened is not None:
            opened.close()
        if self._reader.is_alive() and self._reader is not threading.current_thread():
            self._reader.join(SOURCE_PATIENCE_S if self._drawing else None)
        if opened is None and self._stream is not None:  # the reader was just opening it
            self._stream.close()

    def _read(self) -> None:
        try:
            number = 0
            while (drawn := self._draw()) is not None:
                self._submit(number, drawn)
                number += 1
        except BaseException as error:  # whatever it is, it is raised where the answers are drawn
            if not self._over:
                self._error = error
        finally:
            if self._stream is not None:
                self._stream.end()
            self._started.set()

    def _draw(self) -> Drawn | None:
        """Return the next pair, once there is room for it; None at the end.

        Raises InvalidArgument where the estimator was closed: nothing else ends a stream before its source.
        """
        if self._stream is not None and not self._stream.wait_for_room() and not self._over:
            raise _closed_estimator()
        self._drawing = True
        try:
            # A closer that came before the line above waits for this thread, however long the source takes.
            if self._over:
                return None
            drawn = next(self._pairs, None)
        finally:
            self._drawing = False
        self._exhausted = drawn is None
        return None if self._over else drawn

    @typed_memory_errors()
    def _submit(self, number: int, drawn: Drawn) -> None:
        height, width = drawn.left.shape[:2]
        if self._stream is None:
            self._stream = self._open_stream(width, height)
            self._size = (width, height)
            self._started.set()
            if self._over:  # nobody would make room for a second pair
                return
        self._sources.append((drawn.frame, drawn.dropped))
        # Maps of the first pair's size: one of another size is then refused for what it is.
        maps = self._maps_for(number, self._stream, self._size)
        try:
            self._stream.submit(drawn.left, drawn.right, maps, drawn.stamp_ns)
        except InvalidArgument as error:
            if error.argument == "stream":  # it has ended since there was room
                raise _closed_estimator() from error
            if error.argument == "estimator":
                raise
            which = getattr(drawn.frame, "number", number)  # a source counts those, too, that it dropped
            raise InvalidArgument(error.argument, error.rule, f"{error.value} in frame {which}") from error


def _closed_estimator() -> InvalidArgument:
    return InvalidArgument("estimator", "must be open", "a closed one")


@atexit.register
def _close_all() -> None:
    # The threads of a stream call Python; none may be at work when the interpreter goes.
    for feeder in list(_open_streams):
        feeder.close()
