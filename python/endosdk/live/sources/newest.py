"""The newest frame only: a reader that is slower than its source misses frames, and knows how many."""

from __future__ import annotations

import threading
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
        self.count = source.count
        self.clock: Clock = source.clock
        self.faults = source.faults
        self._change = threading.Condition()
        self._held: Frame | None = None
        self._over: BaseException | bool = False  # True at the end, or the error that ended the source

    def note(self, fault: str) -> None:
        """Keep what went wrong, and warn."""
        self._source.note(fault)

    def _read(self, start: int) -> Iterator[Frame]:
        self._held, self._over = None, False
        stop = threading.Event()
        thread = threading.Thread(target=self._fetch, args=(start, stop), name="endosdk-source", daemon=True)
        start_thread(thread)
        last: int | None = None
        try:
            while (frame := self._take()) is not None:
                if last is not None:  # also what the source itself lost: its numbers go on
                    self.dropped += frame.number - last - 1
                last = frame.number
                yield frame
        finally:
            stop.set()
            thread.join(CLOSING_PATIENCE_S)  # a camera that has stalled is left behind

    def _take(self) -> Frame | None:
        with self._change:
            self._change.wait_for(lambda: self._held is not None or self._over)
            frame, self._held = self._held, None
            if frame is None and isinstance(self._over, BaseException):
                raise self._over
            return frame

    def _fetch(self, start: int, stop: threading.Event) -> None:
        over: BaseException | bool = True
        try:
            for frame in self._source.frames(start):
                if stop.is_set():
                    return
                with self._change:
                    self._held = frame
                    self._change.notify()
        except BaseException as error:  # raised where the frames are drawn
            over = error
        finally:
            with self._change:
                self._over = over
                self._change.notify()

    def close(self) -> None:
        """Close the source that is read."""
        self._source.close()
