"""A source of pairs tied to a compiled stream: pairs are drawn on a thread of their own, answers come in order."""

from __future__ import annotations

import atexit
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Protocol, runtime_checkable

from endosdk import _core
from endosdk.errors import InvalidArgument, typed_memory_errors
from endosdk.runtime.arguments import Picture, check_pair, check_stamp
from endosdk.runtime.maps import Maps
from endosdk.runtime.threads import start_thread

THREAD_NAME = "endosdk-stream"
SOURCE_PATIENCE_S = 0.2  # how long closing waits for a source that is asked for a pair and does not answer

_END = object()


@runtime_checkable
class StereoFrame(Protocol):
    """A pair as `open_source` yields it: RGB or gray, whatever order of channels the estimator has."""

    @property
    def left(self) -> Any:
        """The left view."""

    @property
    def right(self) -> Any:
        """The right view."""

    @property
    def monotonic_ns(self) -> int | None:
        """When it was taken, by the clock of ``time.monotonic_ns()``; None where nobody knows."""


Drawn = tuple[Picture, Picture, int, Any]  # left, right, stamp_ns, the frame as the source yielded it

_open_streams: weakref.WeakSet[Feeder] = weakref.WeakSet()


class Feeder:
    """Draws pairs from a source, submits them to a stream, and gives the answers in order.

    The stream is opened for the size of the first pair. A pair is drawn when there is room for it, so that no more
    frames are on their way or waiting than the stream has lanes.
    """

    def __init__(
        self,
        pairs: Iterator[Any],
        open_stream: Callable[[int, int], _core.Stream],
        maps_for: Callable[[int, _core.Stream, tuple[int, int]], Maps],
        channel_order: str,
    ) -> None:
        self._pairs = pairs
        self._open_stream = open_stream
        self._maps_for = maps_for
        self._channel_order = channel_order
        self._size = (0, 0)  # of the first pair
        self._stream: _core.Stream | None = None
        self._started = threading.Event()  # the stream is open, or never will be
        self._error: BaseException | None = None  # of the source, raised after the answers before it
        self._frames: deque[Any] = deque()  # as the source yielded them, of the pairs that are on their way
        self._over = False
        self._exhausted = False  # the source has no further pair
        self._drawing = False
        self._reader = threading.Thread(target=self._read, name=THREAD_NAME, daemon=True)

    def answers(self) -> Iterator[tuple[_core.FrameReport, Maps, Any]]:
        """Yield what is said of each frame, its maps, and the frame of `open_source` where the source yields those.

        Closing the iterator waits for what is being computed and ends the threads. A source that is held up, a camera
        that has stalled, is left behind: its thread ends when it answers, and does not keep the program from ending.
        """
        start_thread(self._reader)
        _open_streams.add(self)
        try:
            self._started.wait()
            while (answer := self._receive()) is not None:
                yield *answer, self._frames.popleft()
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
            item = next(self._pairs, _END)
        finally:
            self._drawing = False
        self._exhausted = item is _END
        return None if self._exhausted or self._over else _checked(item, self._channel_order)

    @typed_memory_errors()
    def _submit(self, number: int, drawn: Drawn) -> None:
        left, right, stamp_ns, frame = drawn
        height, width = left.shape[:2]
        if self._stream is None:
            self._stream = self._open_stream(width, height)
            self._size = (width, height)
            self._started.set()
            if self._over:  # nobody would make room for a second pair
                return
        self._frames.append(frame)
        # Maps of the first pair's size: one of another size is then refused for what it is.
        maps = self._maps_for(number, self._stream, self._size)
        try:
            self._stream.submit(left, right, maps, stamp_ns)
        except InvalidArgument as error:
            if error.argument == "stream":  # it has ended since there was room
                raise _closed_estimator() from error
            if error.argument == "estimator":
                raise
            which = getattr(frame, "number", number)  # a source counts those, too, that it dropped
            raise InvalidArgument(error.argument, error.rule, f"{error.value} in frame {which}") from error


def _closed_estimator() -> InvalidArgument:
    return InvalidArgument("estimator", "must be open", "a closed one")


@typed_memory_errors()
def _checked(item: Any, channel_order: str) -> Drawn:
    """Return what a source yielded as a stream takes it. Raises InvalidArgument where that cannot be."""
    if isinstance(item, StereoFrame):
        views = check_pair(item.left, item.right)
        if channel_order == "bgr" and all(view.ndim == 3 for view in views):
            views = check_pair(*(view[..., ::-1] for view in views))
        return *views, check_stamp(item.monotonic_ns), item
    if not isinstance(item, tuple | list) or len(item) not in (2, 3):
        rule = "must yield (left, right), (left, right, stamp_ns) or frames of open_source"
        count = f" of {len(item)}" if isinstance(item, tuple | list) else ""
        raise InvalidArgument("source", rule, type(item).__name__ + count)
    return *check_pair(*item[:2]), check_stamp(item[2] if len(item) == 3 else None), None


def drawn_from(function: Callable[[], Any]) -> Iterator[Any]:
    """Yield what a function returns until it returns None, or until an iterator that it draws from ends."""
    # Not iter(function, None), which would compare what the function returns, an array perhaps, with None.
    with suppress(StopIteration):
        while (pair := function()) is not None:
            yield pair


@atexit.register
def _close_all() -> None:
    # The threads of a stream call Python; none may be at work when the interpreter goes.
    for feeder in list(_open_streams):
        feeder.close()
