"""Video files of a recording: lossless FFV1 for what is read again, H.264 for what people play."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import StorageFailed
from endosdk.live.sources.decoder import load_av
from endosdk.live.sources.source import DEFAULT_RATE

RATE = Fraction(DEFAULT_RATE)  # that a file states; the time of each picture is its own
MILLISECONDS = Fraction(1, 1000)  # the clock of Matroska files
# FFV1: every frame by itself, in four slices with check sums, so that one bad byte costs one slice.
LOSSLESS = {"level": "3", "g": "1", "slices": "4", "slicecrc": "1"}
KINDS: dict[str, tuple[str, str, str, dict[str, str]]] = {  # codec, its pixels, ours, options
    "depth": ("ffv1", "gray16le", "gray16le", LOSSLESS),
    "pair": ("ffv1", "bgr0", "rgb24", LOSSLESS),
    "preview": ("libx264", "yuv420p", "rgb24", {"crf": "23", "preset": "veryfast", "bf": "0"}),
}


class VideoWriter:
    """One video file of a kind of `KINDS`; its size is that of the first picture."""

    def __init__(self, path: Path, kind: str) -> None:
        self._av = load_av()
        self._path = path
        self._codec, self._pixels, self._format, self._options = KINDS[kind]
        self._stream: Any = None
        self._last = -1
        try:
            self._file = self._av.open(str(path), "w", format="matroska")
        except self._av.FFmpegError as error:
            raise _failed(path, error) from error

    def add(self, picture: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], stamp_ns: int) -> None:
        """Append a picture at a time after the one before, ns."""
        if self._stream is None:
            self._stream = self._file.add_stream(self._codec, rate=RATE, options=self._options)
            self._stream.height, self._stream.width = picture.shape[:2]
            self._stream.pix_fmt = self._pixels
            self._stream.codec_context.time_base = MILLISECONDS
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format=self._format)
        # The exact time is in the frame's line; a player needs one that grows.
        self._last = max(self._last + 1, stamp_ns // 1_000_000)
        frame.pts, frame.time_base = self._last, MILLISECONDS
        try:
            self._file.mux(self._stream.encode(frame))
        except (self._av.FFmpegError, OSError) as error:
            raise _failed(self._path, error) from error

    def close(self) -> None:
        """Write what is left."""
        try:
            if self._stream is not None:
                self._file.mux(self._stream.encode(None))
            self._file.close()
        except (self._av.FFmpegError, OSError) as error:
            raise _failed(self._path, error) from error


def join(parts: list[Path], out: Path, container: str) -> None:
    """Write the packets of several files of one kind into one; nothing is encoded again."""
    mux({"": parts}, out, container, {})


def mux(tracks: dict[str, list[Path]], out: Path, container: str, attachments: dict[str, bytes]) -> None:
    """Write one file with a track for each kind, each from several files in turn, and files attached to it."""
    av = load_av()
    try:
        with av.open(str(out), "w", format=container) as file:
            streams: dict[str, Any] = {}
            for name, parts in tracks.items():
                with av.open(str(parts[0])) as first:
                    streams[name] = file.add_stream_from_template(first.streams.video[0])
                    streams[name].metadata["title"] = name
            for name, content in attachments.items():
                file.add_attachment(name, "application/json", content)
            for name, parts in tracks.items():
                last = -1
                for part in parts:
                    with av.open(str(part)) as source:
                        for packet in source.demux(source.streams.video[0]):
                            if packet.size:  # the last one is empty
                                packet.stream = streams[name]
                                # Every part counts on by itself from stamps that are equal; the next may begin before.
                                last = max(last + 1, packet.pts)
                                packet.pts = packet.dts = last
                                file.mux(packet)
    except (av.FFmpegError, OSError) as error:
        raise _failed(out, error) from error


def _failed(path: Path, error: Exception) -> StorageFailed:
    return StorageFailed("out", "the video must be writable", f"{path}: {error}")
