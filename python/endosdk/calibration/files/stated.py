"""What every reader hands over, and the steps they share: text in, units, sizes and plausibility out."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rules import CameraModel, check_size
from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, InvalidArgument
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.documents import parse_yaml

Matrix = npt.NDArray[np.float64]

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
USUAL_BASELINE_MM = 2.0  # rigs of endoscopes have 3.5 mm and more
USUAL_OFFSET = 0.2  # of a side, from its middle to the principal point
# How programs name the lens model of a camera. Coefficients of the same model have the same order in all of them.
MODEL_OF: dict[str, CameraModel] = {
    "pinhole": "pinhole",
    "plumb_bob": "pinhole",
    "rational_polynomial": "pinhole",
    "radtan": "pinhole",
    "none": "pinhole",
    "fisheye": "fisheye",
    "equidistant": "fisheye",
    "equi": "fisheye",
}
# A calibration is a few kB. The limit keeps a mistaken path (a video) from being parsed for minutes.
MAX_BYTES = 4 * 1024 * 1024


@dataclass(frozen=True)
class RawCalibration:
    """A rig as its file states it: lengths in ``unit``, ``size`` (width, height) or None where the layout has none.

    ``size_may_be_swapped`` marks a size stored as a bare array, which many programs write as (height, width).
    """

    left_matrix: Matrix
    right_matrix: Matrix
    left_distortion: Matrix
    right_distortion: Matrix
    rotation: Matrix
    translation: Matrix
    size: tuple[int, int] | None
    unit: str
    model: CameraModel = "pinhole"
    size_may_be_swapped: bool = False


@dataclass(frozen=True)
class StatedRig:
    """A rig as the SDK states it, mm and (width, height), before its numbers are checked.

    ``source`` names the file or files in errors, ``unit`` is the one the lengths were read in, ``size_given`` says that
    the caller and not the file gave the size, ``sha256`` is the hash that the file states of its content.
    """

    source: str
    fields: Mapping[str, Any]
    unit: str
    size_given: bool = False
    sha256: str | None = None


def finish(
    raw: RawCalibration, paths: tuple[Path, ...], *, size: tuple[int, int] | None, units: str | None
) -> StatedRig:
    """Settle size and units."""
    source = " + ".join(path.name for path in paths)
    width, height = _settle_size(raw, source, size)
    unit = _settle_unit(raw, source, units)
    fields = {
        "width": width,
        "height": height,
        "left_matrix": raw.left_matrix,
        "right_matrix": raw.right_matrix,
        "left_distortion": trim_distortion(raw.left_distortion),
        "right_distortion": trim_distortion(raw.right_distortion),
        "rotation": raw.rotation,
        "translation": raw.translation * MM_PER_UNIT[unit],
        "model": raw.model,
    }
    _warn_of_the_unusual(fields, source, unit)
    return StatedRig(source, fields, unit, size_given=size is not None)


def _warn_of_the_unusual(fields: Mapping[str, Any], source: str, unit: str) -> None:
    """Warn of what a rig may have, and most often has because a length or a size was read wrongly."""
    log = logging.getLogger("endosdk")
    baseline = float(np.linalg.norm(fields["translation"]))
    if baseline < USUAL_BASELINE_MM:
        log.warning(
            "%s: the baseline is %.3g mm, which is short for an endoscope; lengths were read in %s: pass units= if "
            "that is not their unit",
            *(source, baseline, unit),
        )
    size = np.array([fields["width"], fields["height"]])
    centres = np.array([fields[f"{side}_matrix"][:2, 2] for side in ("left", "right")])
    off = np.abs(centres - (size - 1) / 2) / size
    if (off.max(axis=1) > USUAL_OFFSET).all():
        log.warning(
            "%s: both principal points lie far from the middle of a picture of %dx%d; it would be that of one of about "
            "%dx%d: check the size, unless frames are cropped",
            *(source, *size, *np.rint(2 * centres.mean(axis=0) + 1).astype(int)),
        )


def _settle_unit(raw: RawCalibration, source: str, units: str | None) -> str:
    if units is not None and units not in MM_PER_UNIT:
        raise InvalidArgument("units", f"must be one of {', '.join(MM_PER_UNIT)}", repr(units))
    if units is None and raw.unit not in MM_PER_UNIT:
        rule = f"must be one of {', '.join(MM_PER_UNIT)}, or be given by units="
        raise CalibrationUnreadable(f"{source}: units", rule, repr(raw.unit))
    return units or raw.unit


def _settle_size(raw: RawCalibration, source: str, size: tuple[int, int] | None) -> tuple[int, int]:
    stated = raw.size
    if size is None:
        if stated is None:
            rule = f"must be given as (width, height), because {source} holds no picture size"
            raise CalibrationSizeMismatch("size", rule, None)
        if raw.size_may_be_swapped and stated[0] < stated[1]:
            rule = f"must be given, because the array in {source} may mean (width, height) or (height, width)"
            raise CalibrationSizeMismatch("size", rule, stated)
        return stated
    given = check_size("size", size)
    agrees = stated is None or stated == given or (raw.size_may_be_swapped and stated == given[::-1])
    if not agrees:
        raise CalibrationSizeMismatch("size", f"must agree with {source}, which says {stated}", given)
    return given


def trim_distortion(coefficients: Matrix) -> Matrix:
    """Drop thin-prism and tilt terms (9th to 14th) that are exactly zero; the model without them is the same."""
    flat = np.ravel(coefficients)
    return flat[:8] if flat.size in (12, 14) and not flat[8:].any() else flat


def read_text(path: Path) -> str:
    """Return a file's text. Raises `CalibrationUnreadable` when it cannot be a calibration file."""
    try:
        return read_bounded(path, MAX_BYTES).decode("utf-8-sig")
    except Refused as error:
        raise refusal(path, error) from error
    except UnicodeDecodeError as error:
        raise CalibrationUnreadable(path.name, "must be text in UTF-8", "binary data") from error


def refusal(path: Path, error: Refused) -> CalibrationUnreadable:
    """Return the error of a calibration file that is read no further."""
    return CalibrationUnreadable(path.name, error.rule, error.value)


def read_numbers(path: Path) -> list[list[float]]:
    """Return the rows of a file that holds numbers and nothing else."""
    try:
        return [[float(word) for word in line.split()] for line in read_text(path).splitlines() if line.strip()]
    except ValueError as error:
        raise CalibrationUnreadable(path.name, "must hold numbers only", error) from error


def yaml_mapping(path: Path, text: str | None = None) -> Mapping[str, Any]:
    """Return the top level of a YAML file, which must be a mapping; its scalars are text."""
    try:
        content = parse_yaml(read_text(path) if text is None else text)
    except Refused as error:
        raise refusal(path, error) from error
    if not isinstance(content, dict):
        raise CalibrationUnreadable(path.name, "must be a mapping of names to values", type(content).__name__)
    return content


def matrix(path: Path, name: str, value: Any, shape: tuple[int, ...]) -> Matrix:
    """Return numbers, nested or flat, in ``shape``; -1 leaves a length open."""
    try:
        # float() first: YAML and XML hand numbers over as text.
        flat = np.array([float(part) for part in np.ravel(np.asarray(value, dtype=object))])
        return flat.reshape(shape)
    except (TypeError, ValueError, OverflowError) as error:
        raise CalibrationUnreadable(f"{path.name}: {name}", f"must be numbers of shape {list(shape)}", value) from error


def required(path: Path, content: Mapping[str, Any], *names: str) -> Any:
    """Return the first of several spellings that is there."""
    for name in names:
        if name in content:
            return content[name]
    raise CalibrationUnreadable(path.name, f"must hold {' or '.join(names)}", f"keys {sorted(content)}")


def lens_model(path: Path, name: Any) -> CameraModel:
    """Return the model of a lens whatever program named it."""
    if str(name) not in MODEL_OF:
        rule = f"must be one of {', '.join(MODEL_OF)}"
        raise CalibrationUnreadable(f"{path.name}: distortion_model", rule, name)
    return MODEL_OF[str(name)]


def picture_size(path: Path, width: Any, height: Any) -> tuple[int, int]:
    """Return (width, height) as positive ints, however the file's numbers were written."""
    try:
        sides = float(width), float(height)
    except (TypeError, ValueError, OverflowError) as error:
        raise CalibrationUnreadable(f"{path.name}: size", "must be two numbers", (width, height)) from error
    if any(side <= 0 or side != int(side) for side in sides if np.isfinite(side)) or not np.isfinite(sides).all():
        raise CalibrationUnreadable(f"{path.name}: size", "must be two positive whole numbers", sides)
    return int(sides[0]), int(sides[1])
