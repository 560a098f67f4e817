"""PyAV: from a file, a device or a pipe to RGB pictures with time stamps.

FFmpeg knows every pixel format that cameras and capture cards give (4:2:2, NV12, gray, 10 bits); a picture becomes RGB
uint8 by the colour matrix and range that the stream states.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from endosdk.errors import DependencyMissing, SourceFailed
from endosdk.io.extras import must_install
from endosdk.live.frames import Picture
from endosdk.live.sources.source import DEFAULT_RATE, Scan, stamp_of

if TYPE_CHECKING:
    import av
    import av.filter

DEINTERLACER = "bwdif"  # motion adaptive; one picture a frame, so that frames keep their number
DAMAGED = "the decoder reports damage in this frame"


class Decoded(NamedTuple):
    """One picture as it was decoded."""

    picture: Picture
    stamp_ns: int
    fault: str | None
    counted: bool = False  # the file has no time stamp for it: this one follows from how many came before


def load_av() -> Any:
    """Import PyAV. Raises DependencyMissing."""
    try:
        import av
    except ImportError as error:
        raise DependencyMissing("source", f"needs PyAV, which {must_install('live')}", error) from error
    # PyAV's log stays off, as it is by itself. At any level, a thread that decodes would wait for Python's lock to log,
    # while the thread that closes the file holds the lock and waits for it.
    return av


def reason_of(error: Exception) -> str:
    """Return what an error of FFmpeg says, without PyAV's numbers."""
    return str(getattr(error, "strerror", None) or error)


class Counted:
    """A pipe that knows how many bytes came through it, and what ended the reading of it."""

    def __init__(self, pipe: BinaryIO) -> None:
        self._pipe = pipe
        self._interrupt: KeyboardInterrupt | None = None
        self.count = 0

    def read(self, size: int = -1) -> bytes:
        """Return the next bytes, as the pipe does; none after an interrupt, though FFmpeg asks again, until `check`."""
        if self._interrupt is not None:
            return b""
        try:
            content = self._pipe.read(size)
        except KeyboardInterrupt as interrupt:  # FFmpeg, which calls this, would drop it
            self._interrupt = interrupt
            return b""
        self.count += len(content)
        return content

    def check(self) -> None:
        """Raise the interrupt that came while FFmpeg read."""
        interrupt, self._interrupt = self._interrupt, None
        if interrupt is not None:
            raise interrupt


class Decoder:
    """One video stream that is open. ``name`` is what errors call it; ``note`` is called with what goes wrong."""

    def __init__(
        self,
        file: str | Counted,
        name: str,
        note: Callable[[str], None],
        *,
        scan: Scan = "auto",
        container: str | None = None,
        options: Mapping[str, str] | None = None,
    ) -> None:
        self._av = load_av()
        self._name = name
        self._note = note
        self._scan = scan
        self._check: Callable[[], None] = file.check if isinstance(file, Counted) else lambda: None
        self._reading = threading.Lock()
        self._over = False
        try:
            self._container = self._av.open(file, format=container, options=dict(options or {}))
        except (self._av.FFmpegError, OSError, ValueError) as error:
            self._check()
            rule = "must be a video that FFmpeg can read"
            raise SourceFailed("source", rule, f"{name}: {reason_of(error)}") from error
        self._check()
        if not self._container.streams.video:
            self.close()
            raise SourceFailed("source", "must hold a video stream", name)
        self._stream = self._container.streams.video[0]
        self._stream.thread_type = "AUTO"
        self._graph: av.filter.Graph | None = None
        self._size: tuple[int, int] | None = None
        self._end_of_whole: int | None = None
        self.last_ns = 0  # of the latest picture

    @property
    def rate(self) -> float:
        """Frames a second that the stream states, or the default."""
        return float(self._stream.average_rate or self._stream.guessed_rate or DEFAULT_RATE)

    @property
    def count(self) -> int | None:
        """Number of frames that the file states; None where it does not."""
        return self._stream.frames or None

    @property
    def start_ns(self) -> int:
        """Time of the first frame, ns, also where it cannot be decoded; 0 where the file does not say."""
        start = self._stream.start_time
        return 0 if start is None else round(start * self._stream.time_base * 10**9)

    @property
    def end_ns(self) -> int | None:
        """Time at which the file says it ends, ns; None where it does not say."""
        duration = self._container.duration
        return None if duration is None else round(duration * 1e9 / self._av.time_base)

    @property
    def end_of_whole(self) -> int | None:
        """Where the last packet that is whole ends, in bytes; None before the first, and where nobody knows."""
        return self._end_of_whole

    def close(self) -> None:
        """Close the file. One that another thread is reading, a silent pipe perhaps, is closed by that thread."""
        self._over = True
        if self._reading.acquire(blocking=False):
            try:
                self._container.close()
            finally:
                self._reading.release()

    def pictures(self) -> Iterator[Decoded]:
        """Yield all pictures. Packets that cannot be decoded are noted and passed over."""
        number = 0
        for frame in self._deinterlaced(self._frames()):
            size = frame.width, frame.height
            if self._size not in (None, size):
                raise SourceFailed("source", f"must keep its size, {self._size}", f"{size} from frame {number} on")
            self._size = size
            stamp = stamp_of(number, self.rate) if frame.pts is None else round(frame.pts * frame.time_base * 10**9)
            self.last_ns = stamp
            picture = np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
            if frame.is_corrupt:
                self._note(f"picture {number}: {DAMAGED}")
            yield Decoded(picture, stamp, DAMAGED if frame.is_corrupt else None, frame.pts is None)
            number += 1

    def _frames(self) -> Iterator[Any]:
        packets = self._container.demux(self._stream)
        while (frames := self._next_frames(packets)) is not None:
            yield from frames

    def _next_frames(self, packets: Iterator[Any]) -> list[Any] | None:
        """Return the frames of the next packet; None at the end."""
        with self._reading:
            if self._over:
                self._container.close()  # `close` came while the packet before was decoded
                return None
            try:
                packet = next(packets, None)
            except self._av.FFmpegError as error:
                self._check()
                raise SourceFailed("source", "ended with an error", f"{self._name}: {reason_of(error)}") from error
            self._check()
            if self._over:  # meanwhile
                self._container.close()
                return None
            if packet is None:
                return None
            if packet.is_corrupt:
                self._note("a packet is cut short")
            elif packet.size and packet.pos is not None:
                self._end_of_whole = packet.pos + packet.size
            frames: list[Any] = []
            try:
                frames.extend(packet.decode())
            except self._av.EOFError:
                return None
            except self._av.FFmpegError as error:
                self._note(f"a packet cannot be decoded ({error.strerror}) and is lost")
            return frames

    def _deinterlaced(self, frames: Iterator[Any]) -> Iterator[Any]:
        """Pass frames on, through the deinterlacer where they need it."""
        for frame in frames:
            if self._graph is None and self._needs_fields_joined(frame):
                self._graph = self._new_graph()
            if self._graph is None:
                yield frame
                continue
            self._graph.vpush(frame)
            yield from self._pulled()
        if self._graph is not None:
            self._graph.vpush(None)
            yield from self._pulled()

    def _needs_fields_joined(self, frame: Any) -> bool:
        return self._scan == "interlaced" or (self._scan == "auto" and frame.interlaced_frame)

    def _new_graph(self) -> av.filter.Graph:
        graph: av.filter.Graph = self._av.filter.Graph()
        which = "all" if self._scan == "interlaced" else "interlaced"
        graph.link_nodes(
            graph.add_buffer(template=self._stream),
            graph.add(DEINTERLACER, f"mode=send_frame:deint={which}"),
            graph.add("buffersink"),
        ).configure()
        return graph

    def _pulled(self) -> Iterator[Any]:
        assert self._graph is not None
        while True:
            try:
                yield self._graph.vpull()
            except (self._av.BlockingIOError, self._av.EOFError):
                return
