"""Reads a recording: the very frames it was made of, their depth, and the line on each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.files.native import fields_of
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument, SourceFailed
from endosdk.io.bounded_read import Refused, is_there
from endosdk.live.frames import Frame
from endosdk.live.recording.hashes import hash_of_lines, hash_of_picture
from endosdk.live.recording.sixteen_bits import from_levels
from endosdk.live.recording.texts import LINES, PARTS, RECORD, is_joined, parse_line, parse_record, texts_of
from endosdk.live.sources.decoder import load_av
from endosdk.live.sources.source import DEFAULT_OPTIONS, Source, SourceOptions, log
from endosdk.live.sources.views import split

Map = npt.NDArray[np.float32]
TRACKS = ("preview", "depth", "pair")  # of a recording in one Matroska file: players show the first


class Recording(Source):
    """A recording of ``endosdk run``, a folder or a Matroska file, as a source.

    Frames, numbers, stamps and tags are as they came, unless ``swap`` or `tagged` asks for others. One that was not
    finished gives what is there. ``lines`` has one entry a frame, ``calibration`` is the rig. Lines or pictures whose
    hashes are not those that were recorded end it with `SourceFailed`.
    """

    reading = ()

    def __init__(self, path: str | Path, options: SourceOptions = DEFAULT_OPTIONS) -> None:
        path = Path(path)
        super().__init__(str(path), options)
        rule = "must be a folder or a .mkv file that endosdk run wrote"
        if not is_there(path):
            raise InvalidArgument("source", rule, f"{path}, which is not there")
        if path.is_file() and not is_recording(path):
            raise InvalidArgument("source", rule, path)
        try:
            text, lines = _attached(path) if path.is_file() else texts_of(path)
            record = parse_record(text)
            if record.get("lines_sha256") not in (None, hash_of_lines(lines)):
                raise Refused("must have the lines that it was recorded with", "others")
            self.lines: list[dict[str, Any]] = [parse_line(line) for line in lines]
        except Refused as error:
            raise SourceFailed("source", "must be a whole recording", f"{path}: {error}") from error
        self.settings: dict[str, Any] = record["settings"]
        self._path = path
        self.count = len(self.lines)
        self.clock = self.settings["clock"]
        if not record["complete"]:
            log.warning("%s: was not finished; %d frames are there", path, self.count)

    @property
    def calibration(self) -> StereoCalibration | None:
        """The rig that the depth was computed with; None where there was none."""
        content = self.settings["calibration"]
        try:
            return None if content is None else StereoCalibration(**fields_of(self._path, content))
        except (TypeError, ValueError) as error:
            raise SourceFailed(
                "source", "must hold the rig that it was made with", f"{self.word}: {error!r}"
            ) from error

    def maps(self) -> Iterator[tuple[dict[str, Any], Map]]:
        """Yield the line on every frame and its map, float32 [H, W]: depth in mm, or disparity in px without a rig."""
        step = self.settings["map"]["step"]
        for line, levels in self._with_pictures("depth", "gray16le"):
            yield line, from_levels(levels, step)

    def frames(self, start: int = 0, *, after_ns: int | None = None) -> Iterator[Frame]:
        """Yield the frames whose number is ``start`` or more, with stamps and faults exactly as they were recorded."""
        self.dropped, last = 0, None
        for frame in self._read(start):
            self.dropped += 0 if last is None else frame.number - last - 1
            last = frame.number
            yield self._as_asked(frame)

    def _read(self, start: int) -> Iterator[Frame]:
        if not self.settings["pictures"]:
            raise SourceFailed("source", "must hold pictures: it was recorded without them", self.word)
        for line, pair in self._with_pictures("pair", "rgb24"):
            if line["number"] >= start:
                left, right = split(pair, "side-by-side")
                yield Frame(left, right, line["number"], line["stamp_ns"], line["tag"], line["fault"])

    def _with_pictures(self, kind: str, pixels: str) -> Iterator[tuple[dict[str, Any], Any]]:
        pictures = self._pictures(kind, pixels)
        for line in self.lines:
            picture = next(pictures, None)
            if picture is None:
                raise SourceFailed("source", f"must hold a picture of {kind} for every line", self.word)
            if line.get("sha256", {}).get(kind) not in (None, hash_of_picture(picture)):
                seen = f"{self.word}, whose {kind} of frame {line['number']} is another one"
                raise SourceFailed("source", "must hold the pictures that were recorded", seen)
            yield line, picture

    def _pictures(self, kind: str, pixels: str) -> Iterator[Any]:
        av = load_av()
        for path in files_of(self._path, kind):
            try:
                with av.open(str(path)) as file:
                    for frame in file.decode(video=TRACKS.index(kind) if self._path.is_file() else 0):
                        yield frame.to_ndarray(format=pixels)
            except (av.FFmpegError, OSError, ValueError, IndexError) as error:  # the last two: no such track or pixels
                raise SourceFailed("source", "a file of the recording is damaged", f"{path}: {error}") from error


def is_recording(path: Path) -> bool:
    """Whether a path is a folder or a Matroska file that ``endosdk run`` wrote."""
    if path.suffix.lower() == ".mkv" and path.is_file():
        av = load_av()
        try:
            with av.open(str(path)) as file:
                return any(stream.metadata.get("filename") == RECORD for stream in file.streams.attachments)
        except av.FFmpegError:
            return False
    return is_there(path / RECORD)


def _attached(path: Path) -> tuple[str, list[str]]:
    """Return the record and the lines that are attached to a Matroska file. Raises `Refused`."""
    av = load_av()
    try:
        with av.open(str(path)) as file:
            found = {stream.metadata["filename"]: bytes(stream.data).decode() for stream in file.streams.attachments}
        return found[RECORD], found[LINES].splitlines()
    except (av.FFmpegError, OSError, KeyError, UnicodeDecodeError) as error:
        raise Refused("must have its record and its lines attached", repr(error)) from error


def files_of(path: Path, kind: str) -> list[Path]:
    """Return the video files of one kind, in order: one, or one of each part."""
    if path.is_file():
        return [path]
    if is_joined(path):
        return [path / ("preview.mp4" if kind == "preview" else f"{kind}.mkv")]
    return [part / f"{kind}.mkv" for part in sorted((path / PARTS).glob("*"))]
