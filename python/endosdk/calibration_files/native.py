"""endosdk's own layout: JSON, versioned, with the hash of its content; what is written is read back exactly.

::

    {"format": "endosdk-stereo-calibration", "version": 1,
     "units": "mm", "model": "pinhole" | "fisheye", "width": int, "height": int,
     "left": {"matrix": 3x3, "distortion": [...]}, "right": {"matrix": 3x3, "distortion": [...]},
     "rotation": 3x3, "translation": [x, y, z],            right point = rotation * left point + translation
     "sha256": hash of the fields above without format and version, keys sorted, no blanks}

``sha256`` may be left out of a file written by hand. When it is there it must match.
"""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from endosdk.calibration import StereoCalibration
from endosdk.calibration_files.raw import read_text, required
from endosdk.calibration_rules import check_size
from endosdk.errors import (
    CalibrationSizeMismatch,
    CalibrationUnreadable,
    InvalidArgument,
    InvalidCalibration,
    StorageFailed,
)

FORMAT = "endosdk-stereo-calibration"
VERSION = 1


def looks_like(text: str) -> bool:
    """Whether the text of a file is in this layout, whatever the file is called."""
    return text.lstrip().startswith("{") and f'"{FORMAT}"' in text


def read(
    paths: tuple[Path, ...], *, size: tuple[int, int] | None = None, units: str | None = None
) -> StereoCalibration:
    """Read one endosdk JSON file; ``size`` must agree with it, and ``units`` may only repeat "mm"."""
    if len(paths) != 1 or paths[0].is_dir():
        raise InvalidArgument("path", "an endosdk calibration is one file", [str(path) for path in paths])
    if units not in (None, "mm"):
        raise InvalidArgument("units", "must be left out: an endosdk file is in mm", repr(units))
    path = paths[0]
    content = _parse(path)
    calibration = _build(path, content)
    stated = content.get("sha256")
    if stated is not None and stated != calibration.sha256:
        rule = f"must be the hash of the content, {calibration.sha256}; remove it if the file was edited on purpose"
        raise CalibrationUnreadable(f"{path.name}: sha256", rule, stated)
    if size is not None and check_size("size", size) != (calibration.width, calibration.height):
        rule = f"must agree with {path.name}, which says {(calibration.width, calibration.height)}"
        raise CalibrationSizeMismatch("size", rule, size)
    return calibration


def _parse(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(path))
    except ValueError as error:
        raise CalibrationUnreadable(path.name, "must be valid JSON", error) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        seen = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise CalibrationUnreadable(f"{path.name}: format", f"must be {FORMAT}", seen)
    if content.get("version") != VERSION:
        raise CalibrationUnreadable(f"{path.name}: version", f"must be {VERSION}", content.get("version"))
    if content.get("units") != "mm":
        raise CalibrationUnreadable(f"{path.name}: units", "must be mm", content.get("units"))
    return content


def _build(path: Path, content: dict[str, Any]) -> StereoCalibration:
    cameras = [required(path, content, side) for side in ("left", "right")]
    if not all(isinstance(camera, dict) for camera in cameras):
        raise CalibrationUnreadable(path.name, "left and right must hold matrix and distortion", "something else")
    left, right = cameras
    try:
        return StereoCalibration(
            required(path, content, "width"),
            required(path, content, "height"),
            required(path, left, "matrix"),
            required(path, right, "matrix"),
            required(path, left, "distortion"),
            required(path, right, "distortion"),
            required(path, content, "rotation"),
            required(path, content, "translation"),
            required(path, content, "model"),
        )
    except InvalidCalibration as error:
        raise InvalidCalibration(f"{path.name}: {error.argument}", error.rule, error.value) from error


def write(calibration: StereoCalibration, path: Path) -> None:
    """Write through a temporary file in the same folder, so that a reader never meets half a calibration."""
    document = {"format": FORMAT, "version": VERSION, **calibration.content(), "sha256": calibration.sha256}
    partial: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=path.name, suffix=".partial", dir=path.parent)
        partial = Path(name)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            json.dump(document, stream, indent=1, allow_nan=False)
            stream.write("\n")
        # mkstemp makes the file private; a calibration is meant to be read by others as far as the umask lets them.
        partial.chmod(0o666 & ~_umask())
        partial.replace(path)
    except OSError as error:
        if partial is not None:
            partial.unlink(missing_ok=True)
        raise StorageFailed("path", "must be writable", f"{path} ({error.strerror})") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
