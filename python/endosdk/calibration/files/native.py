"""endosdk's own layout: JSON or YAML, versioned, with the hash of its content; what is written is read back exactly.

::

    {"format": "endosdk-stereo-calibration", "version": 1,
     "units": "mm", "model": "pinhole" | "fisheye", "width": int, "height": int,
     "left": {"matrix": 3x3, "distortion": [...], "field_of_view": [x, y, half width, half height]}, "right": likewise,
     "rotation": 3x3, "translation": [x, y, z],            right point = rotation * left point + translation
     "sha256": hash of the fields above without format and version, keys sorted, no blanks}

``field_of_view`` is optional, px: without it the field of view is found in each picture. ``sha256`` may be left out of
a file written by hand. When it is there it must match.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from endosdk import _core
from endosdk.calibration.files.stated import StatedRig, read_text, refusal, required, yaml_mapping
from endosdk.calibration.rules import check_size
from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, InvalidArgument
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import parse_json
from endosdk.io.whole_files import write_text

FORMAT, VERSION = _core.rig_file_format, _core.rig_file_version
YAML_ENDINGS = (".yaml", ".yml")
ENDINGS = (".json", *YAML_ENDINGS)


def looks_like(text: str) -> bool:
    """Whether the text of a file is in this layout, whatever the file is called."""
    json_like = text.lstrip().startswith("{") and f'"{FORMAT}"' in text
    return json_like or re.search(rf"^format: {FORMAT}\s*$", text, re.MULTILINE) is not None


def read(paths: tuple[Path, ...], *, size: tuple[int, int] | None = None, units: str | None = None) -> StatedRig:
    """Read one endosdk file; ``size`` must agree with it, and ``units`` may only repeat "mm"."""
    if len(paths) != 1 or paths[0].is_dir():
        raise InvalidArgument("path", "an endosdk calibration is one file", [str(path) for path in paths])
    if units not in (None, "mm"):
        raise InvalidArgument("units", "must be left out: an endosdk file is in mm", repr(units))
    path = paths[0]
    content = _parse(path)
    fields = fields_of(path, content)
    stated = (fields["width"], fields["height"])
    if size is not None and check_size("size", size) != stated:
        raise CalibrationSizeMismatch("size", f"must agree with {path.name}, which says {stated}", size)
    return StatedRig(path.name, fields, "mm", sha256=content.get("sha256"))


def _parse(path: Path) -> dict[str, Any]:
    text = read_text(path)
    try:
        content = parse_json(text) if text.lstrip().startswith("{") else _with_numbers(yaml_mapping(path, text))
    except Refused as error:
        raise refusal(path, error) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        seen = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise CalibrationUnreadable(f"{path.name}: format", f"must be {FORMAT}", seen)
    if content.get("version") != VERSION:
        raise CalibrationUnreadable(f"{path.name}: version", f"must be {VERSION}", content.get("version"))
    if content.get("units") != "mm":
        raise CalibrationUnreadable(f"{path.name}: units", "must be mm", content.get("units"))
    return content


def _with_numbers(content: Mapping[str, Any]) -> dict[str, Any]:
    """Turn the text of a YAML file's numbers into numbers; words stay words."""
    words = ("format", "units", "model", "sha256")
    return {name: value if name in words else _numbers(value) for name, value in content.items()}


def _numbers(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _numbers(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_numbers(one) for one in value]
    try:
        return int(value) if value.isdecimal() else float(value)
    except (AttributeError, ValueError):
        return value


def fields_of(path: Path, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `StereoCalibration` that its ``content()`` in a file holds, before they are checked.

    Raises `CalibrationUnreadable`, which names the file, where one is missing.
    """
    cameras = [required(path, content, side) for side in ("left", "right")]
    if not all(isinstance(camera, dict) for camera in cameras):
        raise CalibrationUnreadable(path.name, "left and right must hold matrix and distortion", "something else")
    fields = {name: required(path, content, name) for name in ("width", "height", "rotation", "translation", "model")}
    for side, camera in zip(("left", "right"), cameras, strict=True):
        fields |= {f"{side}_{part}": required(path, camera, part) for part in ("matrix", "distortion")}
        fields[f"{side}_field_of_view"] = camera.get("field_of_view")
    return fields


def write(content: Mapping[str, Any], sha256: str, path: Path) -> None:
    """Write the content of a calibration and its hash, whole or not at all; YAML where the name ends in .yaml or .yml.

    Raises `StorageFailed`.
    """
    document = {"format": FORMAT, "version": VERSION, **content, "sha256": sha256}
    if path.suffix.lower() in YAML_ENDINGS:
        write_text(path, yaml.dump(document, Dumper=NumbersInLines, sort_keys=False, width=120))
    else:
        write_text(path, json.dumps(document, indent=1, allow_nan=False) + "\n")


class NumbersInLines(yaml.SafeDumper):
    """Writes a list of numbers in one line, a float with every digit that it needs."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        """Write a list without lists in it in one line."""
        flat = not any(isinstance(item, list) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=flat)
