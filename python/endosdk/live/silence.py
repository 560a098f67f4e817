"""Tell of a camera or a pipe that does not answer: nothing else would, for a source that has not ended."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from endosdk.live.frames import Frame
from endosdk.live.sources.source import Source
from endosdk.runtime.threads import start_thread

FIRST_S = 2.0  # of silence, after which it is told; then each time that it has doubled
LOOK_S = 0.1


@contextmanager
def told_of_silence(source: Source, frames: Iterator[Frame]) -> Iterator[Iterator[Frame]]:
    """Pass the frames of a source on; meanwhile, note how long it has been asked for one that does not come."""
    if not source.once:  # a file that is read slowly has its frames
        yield frames
        return
    watch = _Watch(source)
    start_thread(watch)
    try:
        yield watch.watched(frames)
    finally:
        watch.over.set()


class _Watch(threading.Thread):
    """Looks at how long ago the source was asked."""

    def __init__(self, source: Source) -> None:
        super().__init__(name="endosdk-silence", daemon=True)
        self._source = source
        self._asked_at: float | None = None
        self.over = threading.Event()

    def watched(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        """Pass frames on."""
        while True:
            self._asked_at = time.monotonic()
            frame = next(frames, None)
            self._asked_at = None
            if frame is None:
                return
            yield frame

    def run(self) -> None:
        """Until it is over."""
        due_s, seen = FIRST_S, None
        while not self.over.wait(LOOK_S):
            asked_at = self._asked_at
            if asked_at is None or asked_at != seen:
                due_s, seen = FIRST_S, asked_at
            elif time.monotonic() - asked_at >= due_s:
                self._source.note(f"no frame for {due_s:.0f} s")
                due_s *= 2
