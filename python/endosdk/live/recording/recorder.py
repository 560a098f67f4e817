"""Writes a recording: a folder of parts, each whole or not there, that become one file of each kind in the end.

So what was written stays readable when the disk is full or the power fails, and the same command goes on from there.
"""

from __future__ import annotations

import json
import shutil
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import parse_json
from endosdk.io.interrupts import interrupts_deferred
from endosdk.io.locks import locked_folder
from endosdk.io.resumable_folder import claim_folder, difference
from endosdk.io.whole_files import whole_folder, whole_path, write_text
from endosdk.live.frames import Frame
from endosdk.live.recording.hashes import hash_of_lines, hash_of_picture
from endosdk.live.recording.result_line import said_of
from endosdk.live.recording.sixteen_bits import STEPS, quantity_of, to_levels
from endosdk.live.recording.texts import FORMAT_VERSION, LINES, PARTS, RECORD, lines_of, parse_line
from endosdk.live.recording.video_files import VideoWriter, join
from endosdk.live.sources.source import Source
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.overview import preview, robust_range
from endosdk.runtime.result import DepthResult

PART_FRAMES = 100


class Recorder:
    """Takes answers one after the other. ``out`` is the folder; what was begun there with the same settings goes on.

    ``pictures`` keeps the frames themselves too, lossless, so that `Recording` gives them back. ``first_number`` is
    the number of its first frame, ``next_number`` that of the first one that is missing, ``last_stamp_ns`` the stamp of
    the one before it. The folder is held until `stop`, which ends a ``with`` block.
    Raises InvalidArgument where ``out`` holds something else or is in use by another recorder, StorageFailed.
    """

    def __init__(
        self, out: Path, estimator: DepthEstimator, source: Source, *, pictures: bool = True, temporal: bool = False
    ) -> None:
        self.out = out
        self._estimator = estimator
        self._settings = settings_of(estimator, source, pictures, temporal)
        self._pictures = pictures
        self._part = ExitStack()
        self._writers: dict[str, VideoWriter] = {}
        self._lines: list[str] = []
        self._ended = False
        with ExitStack() as hold:
            hold.enter_context(locked_folder(out, "out"))
            self._record = _claimed(out, self._settings)
            if self.complete:
                shutil.rmtree(out / PARTS, ignore_errors=True)  # left over where the last moment was cut short
            else:
                # Joined, and stopped before the record said so: all parts are there, and more may follow them.
                (out / LINES).unlink(missing_ok=True)
                (out / PARTS).mkdir(exist_ok=True)
            done = lines_in(out)
            self.next_number = done[-1]["number"] + 1 if done else 0
            self.first_number: int | None = done[0]["number"] if done else None
            self.last_stamp_ns: int | None = done[-1]["stamp_ns"] if done else None
            self._count = 0 if self.complete else len(list((out / PARTS).iterdir()))
            self.frames = len(done)
            self._hold = hold.pop_all()

    def __enter__(self) -> Self:
        """Return the recorder itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop: nothing is lost where an error ends the block."""
        self.stop()

    @property
    def complete(self) -> bool:
        """Whether the recording was closed: there is nothing to add."""
        return bool(self._record["complete"])

    @property
    def begun(self) -> bool:
        """Whether there is a frame, in a part that is whole or in the one in work."""
        return bool(self.frames or self._writers)

    def add(self, frame: Frame, result: DepthResult) -> None:
        """Append one answer, whole: an interrupt waits until it is written.

        Raises InvalidArgument after the end, StorageFailed; the parts before it stay.
        """
        if self._ended or self.complete:
            raise InvalidArgument("recorder", "must not have ended", self.out)
        with interrupts_deferred():
            try:
                if not self._writers:
                    self._begin_part(frame, result)
                if self.first_number is None:
                    self.first_number = frame.number
                self._write(frame, result)
                if len(self._lines) == PART_FRAMES:
                    self._end_part()
            except BaseException as error:
                self._abandon(error)
                raise

    @property
    def source_ended(self) -> bool:
        """Whether a complete recording has all of its source, and was not ended before."""
        return bool(self._record.get("source_ended", True))

    def close(self, *, source_ended: bool = True) -> None:
        """Finish the part in work and join all parts into one file of each kind."""
        self._ended = True
        self._record["source_ended"] = source_ended
        with interrupts_deferred():
            self._end_part()
        if not self.complete and self.frames:
            self._join()

    def stop(self) -> None:
        """Finish the part in work and let go of the folder; another recorder can go on with what is not closed."""
        self._ended = True
        with self._hold, interrupts_deferred():
            self._end_part()

    def _begin_part(self, frame: Frame, result: DepthResult) -> None:
        if self._record["begun_ns"] is None:
            _, _, values = quantity_of(result)
            self._record["begun_ns"] = frame.stamp_ns
            self._record["size"] = _size_of(frame)
            self._record["preview_range"] = robust_range(np.where(result.reasons == 0, values, np.nan))
            self._save()
        # Parts of two sizes would be one file whose header is right for the first alone. Earlier records say none.
        if self._record.get("size", _size_of(frame)) != _size_of(frame):
            raise InvalidArgument("source", f"must keep its size, {self._record['size']}", _size_of(frame))
        self._part = ExitStack()
        folder = self._part.enter_context(whole_folder(self.out / PARTS / f"{self._count:06d}", self.out))
        kinds = ["depth", "preview", *(["pair"] if self._pictures else [])]
        self._folder = folder
        self._writers = {kind: VideoWriter(folder / f"{kind}.mkv", kind) for kind in kinds}
        self._lines = []

    def _write(self, frame: Frame, result: DepthResult) -> None:
        stamp = frame.stamp_ns - self._record["begun_ns"]
        left, _ = self._estimator.rectify(frame.left, frame.right)
        low, high = self._record["preview_range"]
        name, _, values = quantity_of(result)
        kept = {"depth": to_levels(values, result.reasons, STEPS[name])}
        if self._pictures:
            kept["pair"] = np.hstack([frame.left, frame.right])
        for kind, picture in kept.items():
            self._writers[kind].add(picture, stamp)
        self._writers["preview"].add(preview(left, result, low, high), stamp)
        hashes = {kind: hash_of_picture(picture) for kind, picture in kept.items()}
        self._lines.append(json.dumps({**line_of(frame, result), "sha256": hashes}))

    def _end_part(self) -> None:
        if not self._writers:
            return
        writers, self._writers = self._writers, {}
        try:
            for writer in writers.values():
                writer.close()
            write_text(self._folder / LINES, "\n".join(self._lines) + "\n", "out")
        except BaseException as error:
            self._abandon(error)
            raise
        self._part.close()
        self.frames += len(self._lines)
        self._count += 1

    def _abandon(self, error: BaseException) -> None:
        """Remove the part that is not whole."""
        self._writers = {}
        with suppress(StorageFailed):  # the error that is raised is the first one
            self._part.__exit__(type(error), error, error.__traceback__)

    def _join(self) -> None:
        parts = sorted((self.out / PARTS).iterdir())
        for kind in ("depth", "preview", *(["pair"] if self._pictures else [])):
            ending, container = (".mp4", "mp4") if kind == "preview" else (".mkv", "matroska")
            with whole_path(self.out / f"{kind}{ending}", "out") as partial:  # on the disk before the parts are removed
                join([part / f"{kind}.mkv" for part in parts], partial, container)
        lines = lines_of(self.out)
        write_text(self.out / LINES, "\n".join(lines) + "\n", "out")
        self._record.update(complete=True, lines_sha256=hash_of_lines(lines))
        with interrupts_deferred():
            self._save()
            shutil.rmtree(self.out / PARTS, ignore_errors=True)  # what is left of them does not count

    def _save(self) -> None:
        write_text(self.out / RECORD, json.dumps(self._record, indent=1) + "\n", "out")


def _size_of(frame: Frame) -> list[int]:
    """Return width and height of a view."""
    return [frame.left.shape[1], frame.left.shape[0]]


def settings_of(estimator: DepthEstimator, source: Source, pictures: bool, temporal: bool) -> dict[str, Any]:
    """Return what a recording depends on."""
    rig, model, known = estimator.calibration, estimator.model, estimator.diagnostics()
    quantity = "disparity" if rig is None else "depth"
    return {
        "source": source.word,
        "views": {name: getattr(source.options, name) for name in ("layout", "gap", "swap", "scan", "rate", "bits")},
        "clock": source.clock,
        "model": model.identity(),
        **{name: known[name] for name in ("provider", "provider_options")},
        "network_size": None if estimator.network_size is None else list(estimator.network_size),
        "calibration": None if rig is None else rig.content(),
        "map": {"name": quantity, "unit": "px" if rig is None else "mm", "step": STEPS[quantity]},
        "pictures": pictures,
        "temporal": temporal,
        **estimator.limits.described(),
    }


def line_of(frame: Frame, result: DepthResult) -> dict[str, Any]:
    """Return the line on one frame. A tag that is no JSON, or more than is read back, is written as text."""
    return {
        "number": frame.number,
        "stamp_ns": frame.stamp_ns,
        "tag": frame.tag if _is_json(frame.tag) else repr(frame.tag),
        "fault": frame.fault,
        **said_of(result),
    }


def lines_in(out: Path) -> list[dict[str, Any]]:
    """Return the lines of what was recorded so far. Raises InvalidArgument where they are not those of a recorder."""
    try:
        return [parse_line(line) for line in lines_of(out)]
    except Refused as error:
        raise InvalidArgument("out", f"{LINES} must be what this command wrote", f"{out}: {error}") from error


def _claimed(out: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """Return the record of a new folder, or of one that was begun with these settings."""
    compared = {"format_version": FORMAT_VERSION, "settings": settings}
    fresh = {**compared, "begun_ns": None, "preview_range": None, "complete": False}
    return claim_folder(
        out,
        RECORD,
        fresh,
        lambda begun: difference({name: begun.get(name) for name in compared}, compared),
        "must be new, or a recording of the same source, model, rig and limits, begun by this version",
    )


def _is_json(tag: object) -> bool:
    """Whether a tag can be written, and read back as a part of its line."""
    try:
        parse_json(json.dumps({"tag": tag}))
    except (TypeError, ValueError, RecursionError, Refused):
        return False
    return True
