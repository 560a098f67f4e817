"""Video files with two views in one picture, two video files, and video on standard input."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from endosdk.errors import InvalidArgument, SourceFailed
from endosdk.live.frames import Frame
from endosdk.live.sources.decoder import Counted, Decoded, Decoder, load_av
from endosdk.live.sources.source import DEFAULT_RATE, Source, SourceOptions
from endosdk.live.sources.views import split

RAW_RULE = "must be FORMAT:WxH with a pixel format of FFmpeg, such as uyvy422:1920x1080, nv12:1280x720 or gray:640x480"
PIPE_RULE = "standard input must be Y4M (ffmpeg -i FILE -f yuv4mpegpipe -) or described by --raw, in Python raw="
FRAMES_AT_THE_END = 3  # that a file may state and not hold: containers round, and sound may go on


class VideoFile(Source):
    """A video file whose pictures hold both views."""

    reading = ("layout", "scan", "gap")

    def __init__(self, path: Path, options: SourceOptions) -> None:
        super().__init__(str(path), options)
        decoder = self._decoder()  # refuses here what is no video
        self.count = decoder.count
        decoder.close()

    def _decoder(self) -> Decoder:
        return Decoder(self.word, self.word, self.note, scan=self.options.scan)

    def _read(self, start: int) -> Iterator[Frame]:
        decoder = self._decoder()
        try:
            number = -1
            for number, decoded in enumerate(decoder.pictures()):
                if number >= start:  # frames before it are decoded all the same: seeking is not exact in every file
                    yield framed(decoded, number, self.options)
            if (self.count is not None and number + 1 < self.count) or ends_early(decoder):
                self.note(
                    f"ends after {number + 1} frames, {decoder.last_ns / 1e9:.2f} s: earlier than the file states"
                )
        finally:
            decoder.close()


def ends_early(decoder: Decoder) -> bool:
    """Tell whether a file states a later end than that of its latest picture."""
    return decoder.end_ns is not None and decoder.end_ns - decoder.last_ns > FRAMES_AT_THE_END * 1e9 / decoder.rate


class TwoVideos(Source):
    """Two video files, one of each view. Pictures whose time stamps differ by less than half a frame are a pair.

    Each file's stamps count from its own start: some containers start at any time. Pictures without stamps are taken in
    turn. Numbers go on over a picture whose partner is lost.
    """

    reading = ("scan",)

    def __init__(self, left: Path, right: Path, options: SourceOptions) -> None:
        super().__init__(f"{left},{right}", options)
        self._paths = left, right
        decoders = self._decoders()
        counts = [decoder.count for decoder in decoders]
        self.count = None if None in counts else min(count for count in counts if count is not None)
        for decoder in decoders:
            decoder.close()

    def _decoders(self) -> list[Decoder]:
        return [Decoder(str(path), str(path), self.note, scan=self.options.scan) for path in self._paths]

    def _read(self, start: int) -> Iterator[Frame]:
        decoders = self._decoders()
        try:
            half_ns = max(0.5e9 / decoder.rate for decoder in decoders)
            ahead_ns = decoders[0].start_ns - decoders[1].start_ns
            lefts, rights = (decoder.pictures() for decoder in decoders)
            left, right = next(lefts, None), next(rights, None)
            number = 0
            while left is not None and right is not None:
                apart_ns = left.stamp_ns - right.stamp_ns - ahead_ns
                if left.counted or right.counted or abs(apart_ns) < half_ns:
                    if number >= start:
                        yield paired(left, right, number)
                    left, right = next(lefts, None), next(rights, None)
                elif apart_ns < 0:
                    self._pass_over("left", left)
                    left = next(lefts, None)
                else:
                    self._pass_over("right", right)
                    right = next(rights, None)
                number += 1
            if left is not right:  # one of them is None
                shorter = self._paths[0 if left is None else 1]
                self.note(f"{shorter} ends after {number} frames, the other goes on")
            elif all(map(ends_early, decoders)):
                self.note(f"both end after {number} frames: earlier than the files state")
        finally:
            for decoder in decoders:
                decoder.close()

    def _pass_over(self, side: str, alone: Decoded) -> None:
        self.note(f"the {side} picture of {alone.stamp_ns} ns has no partner")


class Piped(Source):
    """Video that comes through a pipe. It can be read once."""

    once = True
    again = False
    reading = ("layout", "scan", "rate", "raw", "gap")

    def __init__(self, file: BinaryIO, options: SourceOptions) -> None:
        super().__init__("standard input", options)
        container, settings = "yuv4mpegpipe", {}
        if options.raw is not None:
            container, settings = "rawvideo", _raw_settings(options.raw, options.rate)
        self._pipe = Counted(file)
        self._decoder = self._opened(container, settings)
        self._begun = False

    def _opened(self, container: str, settings: dict[str, str]) -> Decoder:
        try:
            return Decoder(
                self._pipe, self.word, self.note, scan=self.options.scan, container=container, options=settings
            )
        except SourceFailed as error:
            if not self._pipe.count:
                raise self._nothing() from None
            if self.options.raw is not None:
                raise
            raise SourceFailed("source", PIPE_RULE, error.value) from error

    def _nothing(self) -> SourceFailed:
        rule = "must give a whole frame; look for an error of the program before the pipe"
        return SourceFailed("source", rule, f"{self._pipe.count} bytes of standard input")

    def _read(self, start: int) -> Iterator[Frame]:
        if self._begun:
            raise InvalidArgument("source", "standard input can be read once only", "a second reader")
        self._begun = True
        count = 0
        for number, decoded in enumerate(self._decoder.pictures()):
            count = number + 1
            if number >= start:
                yield framed(decoded, number, self.options)
        if not count:
            raise self._nothing()
        left = self._pipe.count - (self._decoder.end_of_whole or 0)
        if left:
            self.note(f"ends within frame {count}: {left} bytes of it came; {count} frames before it are whole")

    def close(self) -> None:
        """Stop reading."""
        self._decoder.close()


def standard_input(options: SourceOptions) -> Source:
    """Return what comes through standard input: Y4M, or bare pixels where ``options.raw`` describes them."""
    if sys.stdin is None:
        raise SourceFailed("source", "standard input must be open", "none")
    # Without Python's buffer: a thread that waits in a silent pipe holds its lock, for which Python aborts at its end.
    return Piped(getattr(sys.stdin.buffer, "raw", sys.stdin.buffer), options)


def paired(left: Decoded, right: Decoded, number: int) -> Frame:
    """Return the frame of two pictures. The left one's time stamp stands for both."""
    if left.picture.shape != right.picture.shape:
        raise InvalidArgument("source", f"both views must have one size, {left.picture.shape}", right.picture.shape)
    return Frame(left.picture, right.picture, number, left.stamp_ns, fault=left.fault or right.fault)


def framed(decoded: Decoded, number: int, options: SourceOptions) -> Frame:
    """Return the frame of one picture with both views."""
    left, right = split(decoded.picture, options.layout, options.gap)
    height, width = decoded.picture.shape[:2]
    return Frame(left, right, number, decoded.stamp_ns, fault=decoded.fault, picture=(width, height))


def _raw_settings(raw: str, rate: float | None) -> dict[str, str]:
    """Return what FFmpeg must know of bare pixels."""
    match = re.fullmatch(r"([a-z0-9]+):(\d+)x(\d+)", raw)
    if match is None or not 0 < int(match[2]) * int(match[3]) < 2**28:
        raise InvalidArgument("raw", RAW_RULE, repr(raw))
    try:
        load_av().VideoFormat(match[1])
    except ValueError as error:
        raise InvalidArgument("raw", RAW_RULE, repr(raw)) from error
    return {
        "pixel_format": match[1],
        "video_size": f"{match[2]}x{match[3]}",
        "framerate": str(rate or DEFAULT_RATE),
    }
