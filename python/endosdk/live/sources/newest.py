"""The newest frame only: a reader that is slower than its source misses frames, and knows how many."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

from endosdk.live.frames import Frame
from endosdk.live.sources.source import Clock, Source
from endosdk.runtime.threads import start_thread

CLOSING_PATIENCE_S = 1.0


class Newest(Source):
    """Reads ``source`` on a thread of its own and yields the newest frame, each at most once."""

    def __init__(self, source: Source) -> None:
        super().__init__(source.word, source.options)
        self._swap = False  # the source does it
        self._source = source
        self.live = source.live
        self.once = source.once
        self.again = source.again
        self.count = source.count
        self.clock: Clock = source.clock
        self.faults = source.faults

    def note(self, fault: str) -> None:
        """Keep what went wrong, and warn."""
        self._source.note(fault)

    @property
    def fault_count(self) -> int:
        """How much went wrong, as the source has counted."""
        return self._source.fault_count

    def _read(self, start: int) -> Iterator[Frame]:
        latest = _Latest()
        thread = threading.Thread(target=self._fetch, args=(start, latest), name="endosdk-source", daemon=True)
        start_thread(thread)
        try:
            while (frame := latest.take()) is not None:
                yield frame
        finally:
            latest.unread.set()
            thread.join(CLOSING_PATIENCE_S)  # a camera that has stalled is left behind

    def _fetch(self, start: int, latest: _Latest) -> None:
        over: BaseException | bool = True
        begun: int | None = None
        try:
            for frame in self._source.frames(start):
                if not self.live:  # a file does not wait by itself: it plays at the speed that its stamps state
                    now = time.monotonic_ns()
                    begun = now - frame.stamp_ns if begun is None else begun
                    latest.unread.wait(max(0, begun + frame.stamp_ns - now) / 1e9)
                if latest.unread.is_set():
                    return
                latest.put(frame)
        except BaseException as error:  # raised where the frames are drawn
            over = error
        finally:
            latest.end(over)

    def close(self) -> None:
        """Close the source that is read."""
        self._source.close()


class _Latest:
    """What one reader and its thread share: a thread that was left behind must not reach the next reader."""

    def __init__(self) -> None:
        self.unread = threading.Event()  # the reader has gone
        self._change = threading.Condition()
        self._held: Frame | None = None
        self._over: BaseException | bool = False  # True at the end, or the error that ended the source

    def put(self, frame: Frame) -> None:
        with self._change:
            self._held = frame
            self._change.notify()

    def end(self, over: BaseException | bool) -> None:
        with self._change:
            self._over = over
            self._change.notify()

    def take(self) -> Frame | None:
        """Wait for a frame, or return None at the end. Raises what ended the source."""
        with self._change:
            self._change.wait_for(lambda: self._held is not None or self._over)
            frame, self._held = self._held, None
            if frame is None and isinstance(self._over, BaseException):
                raise self._over
            return frame
