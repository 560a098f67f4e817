"""The newest frame only: a reader that is slower than its source misses frames, and knows how many."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

from endosdk.live.frames import Frame
from endosdk.live.sources.source import Clock, Source
from endosdk.runtime.latest import Latest
from endosdk.runtime.newest_pairs import THREAD_NAME
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
        latest: Latest[Frame] = Latest()
        thread = threading.Thread(target=self._fetch, args=(start, latest), name=THREAD_NAME, daemon=True)
        start_thread(thread)
        try:
            while (taken := latest.take()) is not None:
                yield taken[0]  # the numbers of frames tell what was dropped
        finally:
            latest.leave()
            thread.join(CLOSING_PATIENCE_S)  # a camera that has stalled is left behind

    def _fetch(self, start: int, latest: Latest[Frame]) -> None:
        over: BaseException | bool = True
        begun: int | None = None
        try:
            for frame in self._source.frames(start):
                if not self.live:  # a file does not wait by itself: it plays at the speed that its stamps state
                    now = time.monotonic_ns()
                    begun = now - frame.stamp_ns if begun is None else begun
                    latest.left.wait(max(0, begun + frame.stamp_ns - now) / 1e9)
                if latest.left.is_set():
                    return
                latest.put(frame)
        except BaseException as error:  # raised where the frames are drawn
            over = error
        finally:
            latest.end(over)

    def close(self) -> None:
        """Close the source that is read."""
        self._source.close()
