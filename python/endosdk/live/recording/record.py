"""Record the depth of a whole source: a folder, one Matroska file, one MCAP file or a ROS bag."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import is_there
from endosdk.io.progress import progress
from endosdk.io.whole_files import whole_path
from endosdk.live.answers import answers
from endosdk.live.frames import Frame
from endosdk.live.recording.recorder import Recorder, lines_in
from endosdk.live.recording.recording import TRACKS, Recording, files_of
from endosdk.live.recording.texts import LINES, RECORD, lines_of
from endosdk.live.recording.video_files import mux
from endosdk.live.silence import told_of_silence
from endosdk.live.sources.source import Source
from endosdk.runtime.estimator import DepthEstimator

UNFINISHED = ".unfinished"  # added to a file's name: the folder that it is made of
FILES = (".mkv", ".mcap", ".bag", ".ros2")  # a ROS 2 bag is a folder, made in one piece like the files
NO_FILES = (".mp4", ".avi", ".mov", ".webm", ".m4v")


def check_out(out: Path) -> None:
    """Refuse the name of a video that would become a folder. Raises InvalidArgument."""
    if out.suffix.lower() in NO_FILES:
        raise InvalidArgument("out", f"must be a folder, or end in one of {', '.join(FILES)}", out)


def record(
    source: Source,
    estimator: DepthEstimator,
    out: Path,
    *,
    pictures: bool = True,
    most: int | None = None,
    temporal: bool = False,
) -> dict[str, Any]:
    """Record until the source ends, or after ``most`` frames; return how many got which status and which cause.

    ``faults`` are what went wrong with frames. ``notes`` are the latest of what went wrong with the source,
    ``note_count`` says how many there were. ``temporal`` is that of `DepthEstimator.stream`.

    ``out`` is a folder, or ends in one of `FILES`. What was begun there and stopped goes on. A camera or a pipe cannot
    be continued, so a KeyboardInterrupt after its first frame ends the recording as the end of the source does: all
    files are written, and it is not raised again. Raises InvalidArgument, StorageFailed, SourceFailed; what was written
    stays.
    """
    if most is not None and most < 1:
        raise InvalidArgument("frames", "must be at least 1", most)
    check_out(out)
    is_file = out.suffix.lower() in FILES
    if is_file and is_there(out):
        raise InvalidArgument("out", "must not exist yet", out)
    folder = _folder_of(out)
    with Recorder(folder, estimator, source, pictures=pictures, temporal=temporal) as recorder:
        if recorder.frames and source.once:
            rule = "must be new: a camera or a pipe cannot be continued; endosdk replay reads what was recorded"
            raise InvalidArgument("out", rule, folder)
        if recorder.complete and not recorder.source_ended and (most is None or most > recorder.frames):
            raise InvalidArgument("out", f"must be new: it was ended after {recorder.frames} frames", out)
        if not recorder.complete:
            _fill(recorder, source, estimator, most, temporal)
        lines = lines_in(folder)
        if is_file and lines:
            export(Recording(folder), out)
    if is_file:
        shutil.rmtree(folder)
        if not lines:
            raise InvalidArgument("source", "must hold frames", source.word)
    return {
        "frames": len(lines),
        "status": dict(Counter(line["status"] for line in lines)),
        "causes": dict(Counter(cause for line in lines for cause in line["causes"])),
        "faults": [f"frame {line['number']}: {line['fault']}" for line in lines if line["fault"]],
        "notes": list(source.faults),
        "note_count": source.fault_count,
        "dropped": source.dropped,
    }


def begun(out: Path) -> tuple[Path, int]:
    """Return the folder that holds what was recorded of ``out`` so far, and how many frames it has."""
    folder = _folder_of(out)
    return folder, len(lines_in(folder))


def _folder_of(out: Path) -> Path:
    return out.with_name(out.name + UNFINISHED) if out.suffix.lower() in FILES else out


def _fill(recorder: Recorder, source: Source, estimator: DepthEstimator, most: int | None, temporal: bool) -> None:
    done = 0
    left = None if most is None else most - recorder.frames
    # What a source says of its length is no limit: the header of a video may be wrong.
    expected = [each - recorder.frames for each in (source.count, most) if each is not None]
    start, after = recorder.next_number, recorder.last_stamp_ns
    drawn = source.frames(start, after_ns=after) if left is None or left > 0 else iter(())
    with progress(total=min(expected, default=None), unit="frame") as bar, told_of_silence(source, drawn) as told:
        frames = _Drawn(told)
        try:
            for frame, result in answers(estimator, frames, reuse=True, temporal=temporal):
                recorder.add(frame, result)
                bar.update()
                done += 1
                if done == left:
                    break
        except KeyboardInterrupt:
            if not (source.once and recorder.begun):
                raise
        ended = left is None or done < left or (left > 0 and not source.once and frames.is_over(done))
    recorder.close(source_ended=ended)


class _Drawn:
    """Passes frames on and counts them: those that are computed ahead have been drawn already."""

    def __init__(self, frames: Iterator[Frame]) -> None:
        self._frames = frames
        self._count = 0

    def __iter__(self) -> Iterator[Frame]:
        for frame in self._frames:
            self._count += 1
            yield frame

    def is_over(self, done: int) -> bool:
        """Tell whether there is no frame after so many."""
        return self._count <= done and next(self._frames, None) is None


def export(recording: Recording, out: Path) -> None:
    """Write a recording as one Matroska file, one MCAP file, a ROS 1 bag (``.bag``) or a ROS 2 bag (a folder).

    Raises InvalidArgument where it has no frames, StorageFailed.
    """
    if not recording.count:
        raise InvalidArgument("recording", "must hold frames", recording.word)
    with whole_path(out, "out") as partial:
        if out.suffix.lower() == ".mkv":
            _write_matroska(recording, partial)
        else:
            from endosdk.live.recording.bags import write_bag

            write_bag(recording, partial, out)


def _write_matroska(recording: Recording, out: Path) -> None:
    """One file with the tracks preview, depth and pair; the record and the lines are attached to it."""
    folder = Path(recording.word)
    kinds = TRACKS if recording.settings["pictures"] else TRACKS[:2]
    attachments = {
        RECORD: (folder / RECORD).read_bytes(),
        LINES: ("\n".join(lines_of(folder)) + "\n").encode(),
    }
    mux({kind: files_of(folder, kind) for kind in kinds}, out, "matroska", attachments)
