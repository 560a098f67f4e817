"""The newest pair of a source that does not wait: read on a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Iterator

from endosdk.runtime.drawn import SOURCE_PATIENCE_S, Drawn
from endosdk.runtime.latest import Latest
from endosdk.runtime.threads import start_thread

THREAD_NAME = "endosdk-source"


class NewestPairs:
    """Reads pairs as fast as they come, and yields the newest one, each at most once."""

    def __init__(self, pairs: Iterator[Drawn]) -> None:
        self._pairs = pairs
        self._latest: Latest[Drawn] = Latest()
        self._reader: threading.Thread | None = None

    def __iter__(self) -> Iterator[Drawn]:
        return self

    def __next__(self) -> Drawn:
        """Return the newest pair, and how many were dropped before it. Raises what ended the source in its place."""
        if self._reader is None:
            self._reader = threading.Thread(target=self._read, name=THREAD_NAME, daemon=True)
            start_thread(self._reader)
        taken = self._latest.take()
        if taken is None:
            raise StopIteration
        pair, dropped = taken
        return pair._replace(dropped=dropped)

    def close(self) -> None:
        """End the reading. A source that is asked for a pair and does not answer is left behind."""
        self._latest.leave()
        if self._reader is not None and self._reader is not threading.current_thread():
            self._reader.join(SOURCE_PATIENCE_S)

    def _read(self) -> None:
        over: BaseException | bool = True
        try:
            for pair in self._pairs:
                if self._latest.left.is_set():
                    return
                self._latest.put(pair.kept())
        except BaseException as error:  # raised where the answers are drawn
            over = error
        finally:
            self._latest.end(over)
