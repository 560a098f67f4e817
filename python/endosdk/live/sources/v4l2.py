"""Cameras and capture cards of Linux (V4L2), one with both views or two with one each."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from endosdk.errors import SourceFailed
from endosdk.live.frames import Frame
from endosdk.live.sources.decoder import Decoded, Decoder
from endosdk.live.sources.source import Clock, Source, SourceOptions
from endosdk.live.sources.video_input import framed, paired

V4L2 = "v4l2"
PATIENCE_S = 10.0  # how long a camera may be away before that ends the source
RETRY_S = 0.25
INTERVALS = 9  # between frames, at most, of which half say what is usual
LEAST_INTERVALS = 3


class Device:
    """One V4L2 device, opened again when it comes back after it was unplugged.

    ``container`` is FFmpeg's name of the interface. ``patience_s`` is how long the device may be away.
    """

    def __init__(
        self,
        source: Source,
        path: str,
        options: SourceOptions,
        container: str | None = V4L2,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._source = source
        self._path = path
        self._options = options
        self._container = container
        self._patience_s = patience_s
        self._closed = False
        self._decoder = self._opened()  # the first time at once: a wrong name is refused right away
        self.period_ns = 1e9 / self._decoder.rate

    def _opened(self) -> Decoder:
        settings = {"ts": "mono2abs"} if self._container == V4L2 else {}  # wall clock at capture
        if self._options.rate is not None:
            settings["framerate"] = str(self._options.rate)
        return Decoder(
            self._path,
            self._path,
            self._source.note,
            scan=self._options.scan,
            container=self._container,
            options=settings,
        )

    def pictures(self) -> Iterator[Decoded]:
        """Yield pictures as long as the device is there, or comes back in time. Raises SourceFailed."""
        gap: str | None = None
        while True:
            try:
                for decoded in self._decoder.pictures():
                    yield decoded._replace(fault=decoded.fault or gap)
                    gap = None
                reason = "it sends no more"
            except SourceFailed as error:
                reason = str(error.value)
            if self._closed:
                return
            gap = f"first frame after {self._path} was away"
            self._source.note(f"{self._path} is gone ({reason}); waiting {self._patience_s:g} s for it")
            self._reopen(reason)
            if self._closed:
                self._decoder.close()  # it may have been opened meanwhile
                return
            self._source.note(f"{self._path} is back")

    def _reopen(self, reason: str) -> None:
        self._decoder.close()
        deadline = time.monotonic() + self._patience_s
        while time.monotonic() < deadline and not self._closed:
            time.sleep(RETRY_S)
            if Path(self._path).exists():
                try:
                    self._decoder = self._opened()
                    return
                except SourceFailed as error:  # there, but not ready yet
                    reason = str(error.value)
        if self._closed:
            return
        raise SourceFailed("source", f"the device must come back within {self._patience_s:g} s", reason)

    def close(self) -> None:
        """Let go of the device; its pictures end."""
        self._closed = True
        self._decoder.close()


class Camera(Source):
    """A device whose pictures hold both views. Numbers go on over frames that the driver lost."""

    live = True
    once = True
    clock: Clock = "wall"
    reading = ("layout", "scan", "rate", "gap")

    def __init__(self, path: str, options: SourceOptions) -> None:
        super().__init__(path, options)
        self._device = Device(self, path, options)

    def _read(self, start: int) -> Iterator[Frame]:
        number, missing = -1, Missing(self._device.period_ns)
        for decoded in self._device.pictures():
            number += 1 + missing.before(decoded.stamp_ns)
            if number >= start:
                yield framed(decoded, number, self.options)

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()


class TwoCameras(Source):
    """Two devices, one of each view. Pictures whose time stamps differ by less than half a frame are a pair."""

    live = True
    once = True
    clock: Clock = "wall"
    reading = ("scan", "rate")

    def __init__(self, left: str, right: str, options: SourceOptions) -> None:
        super().__init__(f"{left},{right}", options)
        self._devices = Device(self, left, options), Device(self, right, options)

    def _read(self, start: int) -> Iterator[Frame]:
        period_ns = max(device.period_ns for device in self._devices)
        views = [device.pictures() for device in self._devices]
        number, missing = -1, Missing(period_ns)
        for left, right in simultaneous(views[0], views[1], period_ns / 2):
            number += 1 + missing.before(left.stamp_ns)
            if number >= start:
                yield paired(left, right, number)

    def close(self) -> None:
        """Let go of the devices."""
        for device in self._devices:
            device.close()


class Missing:
    """Counts the frames that a driver lost, by their time stamps.

    In little light a camera gives fewer frames than it states. So the period is the usual one of the latest frames
    where that is longer than ``period_ns``. So a driver that loses every second frame looks like a slower camera, and a
    camera that has just become slower seems to lose a few.
    """

    def __init__(self, period_ns: float) -> None:
        self._stated_ns = period_ns
        self._intervals: deque[int] = deque(maxlen=INTERVALS)
        self._last_ns: int | None = None

    def before(self, stamp_ns: int) -> int:
        """Return how many frames are missing before the one of this time."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None:
            return 0
        self._intervals.append(stamp_ns - last_ns)
        period_ns = self._stated_ns
        if len(self._intervals) >= LEAST_INTERVALS:
            period_ns = max(period_ns, median(self._intervals))
        return max(0, round((stamp_ns - last_ns) / period_ns) - 1)


def simultaneous(
    left: Iterator[Decoded], right: Iterator[Decoded], tolerance_ns: float
) -> Iterator[tuple[Decoded, Decoded]]:
    """Pair pictures of the same time; the older of two that are no pair is passed over."""
    a, b = next(left, None), next(right, None)
    while a is not None and b is not None:
        apart = a.stamp_ns - b.stamp_ns
        if abs(apart) < tolerance_ns:
            yield a, b
            a, b = next(left, None), next(right, None)
        elif apart < 0:
            a = next(left, None)
        else:
            b = next(right, None)
