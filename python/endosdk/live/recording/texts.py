"""The two texts of a recording, which a stranger may have made: the record, and a line of JSON on every frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.documents import parse_json
from endosdk.live.recording.sixteen_bits import STEPS
from endosdk.live.sources.source import Clock

FORMAT_VERSION = 1
RECORD = "recording.json"
LINES = "frames.jsonl"
PARTS = "parts"

LARGEST_RECORD = 1 << 20  # bytes
LARGEST_LINES = 1 << 32  # bytes: a day of 60 frames a second


def texts_of(folder: Path) -> tuple[str, list[str]]:
    """Return the record and the lines of a recording in a folder, finished or not. Raises `Refused`."""
    return _text(folder / RECORD, LARGEST_RECORD), lines_of(folder)


def is_joined(folder: Path) -> bool:
    """Whether there is one file of each kind: the lines are written last of them. Parts beside them do not count."""
    return (folder / LINES).is_file()


def lines_of(folder: Path) -> list[str]:
    """Return the lines of a recording in a folder, finished or not. Raises `Refused`."""
    joined = is_joined(folder)
    files = [folder / LINES] if joined else [part / LINES for part in sorted((folder / PARTS).glob("*"))]
    return [line for file in files for line in _text(file, LARGEST_LINES).splitlines()]


def parse_record(text: str) -> dict[str, Any]:
    """Return a record with all that is read of it. Raises `Refused`."""
    record = _mapping(parse_json(text))
    if record.get("format_version") != FORMAT_VERSION:
        raise Refused(f"must be a recording of format {FORMAT_VERSION}", record.get("format_version"))
    settings = _mapping(record.get("settings"))
    if not isinstance(settings.get("pictures"), bool) or not isinstance(record.get("complete"), bool):
        raise Refused("must say whether it is complete and has pictures", "neither true nor false")
    if settings.get("clock") not in get_args(Clock):
        raise Refused(f"must have a clock that is one of {', '.join(get_args(Clock))}", repr(settings.get("clock")))
    kept = _mapping(settings.get("map"))
    if not isinstance(kept.get("name"), str) or STEPS.get(kept["name"]) != kept.get("step"):
        raise Refused(f"must have a map and its step, one of {STEPS}", kept)
    if not isinstance(settings.get("calibration", ""), dict | None):
        raise Refused("must have a calibration, null where there is none", "another kind of value")
    if not isinstance(record.get("lines_sha256"), str | None):
        raise Refused("must have the hash of its lines as text", record["lines_sha256"])
    return record


def parse_line(text: str) -> dict[str, Any]:
    """Return the line on one frame with all that is read of it. Raises `Refused`."""
    line = _mapping(parse_json(text))
    for name in ("number", "stamp_ns"):
        value = line.get(name)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
            raise Refused(f"must have a whole {name}", repr(value))
    if not isinstance(line.get("status"), str) or not isinstance(line.get("fault"), str | None) or "tag" not in line:
        raise Refused("must have a status, a fault and a tag on every frame", f"frame {line['number']}")
    _mapping(line.get("causes"))
    _mapping(line.get("sha256", {}))
    return line


def _text(path: Path, limit: int) -> str:
    try:
        return read_bounded(path, limit).decode()
    except UnicodeDecodeError as error:
        raise Refused("must be UTF-8", error) from error


def _mapping(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise Refused("must hold named entries", type(value).__name__)
    return value
