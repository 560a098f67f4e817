"""Two folders of pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from endosdk.errors import InvalidArgument
from endosdk.io.picture_pairs import pair_pictures
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Frame
from endosdk.live.sources.source import DEFAULT_RATE, Clock, Source, SourceOptions, stamp_of


class Folders(Source):
    """The pictures of two folders, paired by the numbers in their names as ``endosdk batch`` pairs them.

    Numbers go on over a pair of which a picture cannot be read, but for the first one.
    """

    clock: Clock = "counted"
    reading = ("rate", "bits")

    def __init__(self, left: Path, right: Path, options: SourceOptions) -> None:
        super().__init__(f"{left},{right}", options)
        self._pairs = pair_pictures(left, right)
        self._rate = options.rate or DEFAULT_RATE
        self.count = len(self._pairs)

    def _read(self, start: int) -> Iterator[Frame]:
        for number, (left, right) in enumerate(self._pairs[start:], start):
            try:
                views = [read_frame(path, bits=self.options.bits) for path in (left, right)]
            except InvalidArgument as error:
                if number == 0:  # as when all need another option
                    raise
                self.note(f"pair {number} is lost: {error}")
                continue
            yield Frame(views[0], views[1], number, stamp_of(number, self._rate))
