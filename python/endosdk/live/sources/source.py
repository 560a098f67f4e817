"""What all sources have in common."""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, Self, get_args

from endosdk.errors import InvalidArgument
from endosdk.io.pictures import check_bits
from endosdk.live.frames import Frame

Layout = Literal["side-by-side", "top-bottom", "rows", "side-by-side-half", "top-bottom-half", "rows-half"]
Queue = Literal["auto", "every", "newest"]
Scan = Literal["auto", "interlaced", "progressive"]
# What a stamp counts from: the start of the medium, the wall clock at capture (1970), or frames at a rate.
Clock = Literal["medium", "wall", "counted"]

DEFAULT_RATE = 25.0
MOST_FAULTS = 100  # that a source keeps the texts of, the latest

log = logging.getLogger("endosdk")


@dataclass(frozen=True)
class SourceOptions:
    """The keywords of `open_source`, checked."""

    layout: Layout = "side-by-side"
    queue: Queue = "auto"
    scan: Scan = "auto"
    rate: float | None = None
    raw: str | None = None
    bits: int | None = None
    swap: bool = False
    gap: int = 0

    def __post_init__(self) -> None:
        for name, choices in (("layout", Layout), ("queue", Queue), ("scan", Scan)):
            if getattr(self, name) not in get_args(choices):
                raise InvalidArgument(name, f"must be one of {', '.join(get_args(choices))}", repr(getattr(self, name)))
        if self.rate is not None and not (math.isfinite(self.rate) and 0 < self.rate <= 1000):
            raise InvalidArgument("rate", "must be frames a second, above 0 and at most 1000", self.rate)
        check_bits(self.bits)
        if not isinstance(self.swap, bool):
            raise InvalidArgument("swap", "must be True or False", repr(self.swap))
        if isinstance(self.gap, bool) or not isinstance(self.gap, int) or self.gap < 0:
            raise InvalidArgument("gap", "must be whole pixels, 0 or more", repr(self.gap))
        if self.layout.startswith("rows"):
            if self.gap:
                raise InvalidArgument("gap", "must be 0 where the views take turns by rows", self.gap)
            if self.scan == "interlaced":
                raise InvalidArgument("scan", "must not be interlaced where the views take turns by rows", self.scan)
            object.__setattr__(self, "scan", "progressive")  # the rows of two views are not the fields of one


DEFAULT_OPTIONS = SourceOptions()
READING = ("layout", "scan", "rate", "raw", "bits", "gap")  # options that say how something of the kind is read


class Source(ABC):
    """Stereo frames, one after the other. Iterate over it; close it, or use it in a ``with``.

    ``word`` names it, ``live`` says that it does not wait for its reader, ``once`` that its frames cannot be had again,
    as those of a camera or a pipe, ``again`` that a second reader gets frames too, ``clock`` what time stamps count
    from, ``count`` is how many frames there are by what it says itself, None where nobody knows. ``options`` says how
    it is read; ``reading`` names the `READING` that mean something for its kind, and others are refused. ``dropped``
    counts the frames that the latest reader never got, by the gaps in their numbers. ``faults`` holds the latest of
    what went wrong without ending the source, ``fault_count`` says how many there were; each is also a warning of the
    log ``endosdk``.
    """

    live: bool = False
    once: bool = False
    again: bool = True
    reading: tuple[str, ...] = READING
    clock: Clock = "medium"
    count: int | None = None

    def __init__(self, word: str, options: SourceOptions = DEFAULT_OPTIONS) -> None:
        for name in READING:
            if name not in self.reading and getattr(options, name) != getattr(DEFAULT_OPTIONS, name):
                rule = f"means nothing for this kind of source ({word}): leave it out"
                raise InvalidArgument(name, rule, getattr(options, name))
        self.word = word
        self.options = options
        self._swap = options.swap
        self.dropped = 0
        self.faults: list[str] = []
        self._fault_count = 0
        self._tagger: Callable[[Frame], Any] | None = None

    def __iter__(self) -> Iterator[Frame]:
        return self.frames()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def frames(self, start: int = 0, *, after_ns: int | None = None) -> Iterator[Frame]:
        """Yield the frames from number ``start`` on, with time stamps after ``after_ns``, that of the frame before it.

        Raises `SourceFailed` in the place of the first frame that cannot be had any more.
        """
        order = _TimeOrder(after_ns)
        self.dropped, last = 0, start - 1
        for frame in self._read(start):
            self.dropped += frame.number - last - 1
            last = frame.number
            stamp, fault = order.next(frame.stamp_ns)
            if fault is not None:
                self.note(f"frame {frame.number}: {fault}")
                fault = _joined(frame.fault, fault)
            taken = frame.monotonic_ns or self._taken(stamp)
            yield self._as_asked(replace(frame, stamp_ns=stamp, fault=fault or frame.fault, monotonic_ns=taken))

    def _as_asked(self, frame: Frame) -> Frame:
        """Return a frame with its views exchanged and its tag attached, where either was asked for."""
        if self._swap:
            frame = replace(frame, left=frame.right, right=frame.left)
        if self._tagger is not None:
            frame = replace(frame, tag=self._tagger(frame))
        return frame

    def _taken(self, stamp_ns: int) -> int | None:
        """Turn a live source's stamp, of the wall clock, into one of the monotonic clock, from which ages follow."""
        if not self.live or self.clock != "wall":
            return None
        now = time.monotonic_ns()
        return min(now, max(1, now - (time.time_ns() - stamp_ns)))

    def tagged(self, tagger: Callable[[Frame], Any]) -> Self:
        """Let ``tagger`` attach a tag to every frame, such as the pose of a robot; return this source."""
        self._tagger = tagger
        return self

    def note(self, fault: str) -> None:
        """Keep what went wrong, and warn."""
        log.warning("%s: %s", self.word, fault)
        self._fault_count += 1
        self.faults.append(fault)
        del self.faults[:-MOST_FAULTS]

    @property
    def fault_count(self) -> int:
        """How much went wrong without ending the source."""
        return self._fault_count

    @abstractmethod
    def _read(self, start: int) -> Iterator[Frame]:
        """Yield the frames from ``start`` on as they come."""

    def close(self) -> None:  # noqa: B027 - most sources hold nothing
        """Let go of files and devices; frames that were yielded stay good."""


class _TimeOrder:
    """Makes time stamps grow. One that runs backwards is a fault; a clock that began anew goes on from where it was.

    ``last`` is the stamp that the frame before was given, None where there is none.
    """

    def __init__(self, last: int | None = None) -> None:
        self._last = last  # as it was given on
        self._came: int | None = None  # as it came
        self._added = 0
        self._was_back = False

    def next(self, stamp: int) -> tuple[int, str | None]:
        """Return the stamp to give on, ns, and what was wrong."""
        last, came, fault = self._last, self._came, None
        out = stamp + self._added
        if last is None and stamp < 0:  # as of a video that was cut out of a longer one
            self._added, out = -stamp, 0
            fault = f"time stamps begin at {stamp} ns; {-stamp} ns are added"
        elif last is None or out > last:
            self._was_back = False
        elif came is None or (self._was_back and stamp > came):  # two that go together: the clock itself is another
            self._added = last + (1 if came is None else stamp - came) - stamp
            fault = f"time stamps began anew before {stamp} ns; from here on {self._added} ns are added"
            out, self._was_back = stamp + self._added, False
        else:
            fault = f"time stamp {stamp} ns is not after the one before, {came} ns; counted on from there"
            out, self._was_back = last + 1, True
        self._last, self._came = out, stamp
        return out, fault


def stamp_of(number: int, rate: float) -> int:
    """Return the time of a frame that has no stamp of its own, ns."""
    return round(number * 1e9 / rate)


def _joined(first: str | None, second: str) -> str:
    return second if first is None else f"{first}; {second}"
