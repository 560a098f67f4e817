"""Read and write calibration files: one module per layout, the choice between them here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from endosdk.calibration.files import foundationstereo, kalibr, native, opencv, ros, text_folder
from endosdk.calibration.files.stated import RawCalibration, StatedRig, finish, read_text, yaml_mapping
from endosdk.errors import CalibrationUnreadable, InvalidArgument
from endosdk.io.bounded_read import is_there

Reader = Callable[[tuple[Path, ...]], RawCalibration]

# Most "opencv" files do not say whether their four coefficients are Brown-Conrady or fisheye, so the caller may.
READERS: dict[str, Reader] = {
    "foundationstereo": foundationstereo.read,
    "kalibr": kalibr.read,
    "opencv": opencv.read,
    "opencv-fisheye": opencv.read_fisheye,
    "ros": ros.read,
    "text": text_folder.read,
}
LAYOUTS = ("endosdk", *READERS)


def read(
    path: str | Path | Sequence[str | Path],
    *,
    size: tuple[int, int] | None = None,
    layout: str | None = None,
    units: str | None = None,
) -> StatedRig:
    """Read what a calibration of any known layout states; see `StereoCalibration.load`."""
    paths = _existing_paths(path)
    if layout is not None and layout not in LAYOUTS:
        raise InvalidArgument("layout", f"must be one of {', '.join(LAYOUTS)}", repr(layout))
    chosen = layout or recognise(paths)
    if chosen == "endosdk":
        return native.read(paths, size=size, units=units)
    return finish(READERS[chosen](paths), paths, size=size, units=units)


def recognise(paths: tuple[Path, ...]) -> str:
    """Name the layout of a folder, a file or a pair of files from its content."""
    first = paths[0]
    if first.is_dir():
        return "text"
    text = read_text(first)
    if native.looks_like(text):
        return "endosdk"
    if first.suffix.lower() == ".json":
        return "opencv"
    if opencv.is_file_storage(first, text):
        return "opencv"
    if foundationstereo.looks_like(text):
        return "foundationstereo"
    keys = yaml_mapping(first, text).keys()
    for name, matches in (("kalibr", kalibr.looks_like), ("ros", ros.looks_like), ("opencv", opencv.looks_like)):
        if matches(keys):
            return name
    raise CalibrationUnreadable(first.name, f"must be in a known layout ({', '.join(LAYOUTS)})", f"keys {list(keys)}")


def _existing_paths(path: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    parts: list[Any] = list(path) if isinstance(path, list | tuple) else [path]
    if not 1 <= len(parts) <= 2 or not all(isinstance(part, str | Path) for part in parts):
        raise InvalidArgument("path", "must be a file, a folder or a pair of files", repr(path))
    paths = tuple(Path(part) for part in parts)
    for part in paths:
        if not is_there(part):
            raise CalibrationUnreadable("path", "must be a file or folder that exists", part)
    if len(paths) == 2 and any(part.is_dir() for part in paths):
        raise InvalidArgument("path", "a pair must be two files", [str(part) for part in paths])
    return paths
