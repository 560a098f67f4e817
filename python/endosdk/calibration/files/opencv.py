"""OpenCV's YAML, XML and JSON, under the spellings that are in use; lengths in mm unless the caller says otherwise.

OpenCV's own sample writes two files, the cameras and the extrinsics; both may be given as a pair. Plain YAML with
nested lists under the same names is read too. Most files do not say whether four coefficients are those of a fisheye;
a ``distortion_model`` does, a flag such as ``fisheye_model``, or a ``camera_model`` of that name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from endosdk.calibration.files.stated import (
    MODEL_OF,
    RawCalibration,
    lens_model,
    matrix,
    picture_size,
    read_text,
    refusal,
)
from endosdk.calibration.rules import CameraModel
from endosdk.errors import CalibrationUnreadable
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import parse_json, parse_opencv_xml, parse_yaml

# Spellings are compared in lower case without separators. "k1" and "d1" are OpenCV's samples, "m1" its old ones.
SPELLINGS: dict[str, tuple[str, ...]] = {
    name: tuple(spellings.split())
    for name, spellings in {
        "left_matrix": "k1 m1 cameramatrix1 cameramatrixleft leftcameramatrix cameramatrixl kleft kl "
        "leftmatrix mtxl mtx1 leftk intrinsicleft leftintrinsic intrinsicsleft leftintrinsics",
        "right_matrix": "k2 m2 cameramatrix2 cameramatrixright rightcameramatrix cameramatrixr kright kr "
        "rightmatrix mtxr mtx2 rightk intrinsicright rightintrinsic intrinsicsright rightintrinsics",
        "left_distortion": "d1 distcoeffs1 distcoefs1 dist1 distortion1 distortioncoefficients1 "
        "distcoeffsleft leftdistcoeffs distcoeffsl distleft dleft dl leftdistortion distl leftd distortionleft "
        "leftdistortioncoefficients",
        "right_distortion": "d2 distcoeffs2 distcoefs2 dist2 distortion2 distortioncoefficients2 "
        "distcoeffsright rightdistcoeffs distcoeffsr distright dright dr rightdistortion distr rightd distortionright "
        "rightdistortioncoefficients",
        "rotation": "r rotation rotationmatrix rmatrix rot",
        "translation": "t translation translationvector tvec tvector trns",
        "size": "imagesize imgsize calibrationimagesize",
        "some_size": "size resolution",  # of the pictures, unless these state their width and height
        "width": "width imagewidth imgwidth",
        "height": "height imageheight imgheight",
        "model": "distortionmodel",
    }.items()
}
FIELD_OF = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings}
# What many files say beside the numbers, each in its own way. A camera's model may also be the name of a product.
CAMERA = ("cameramodel", "lensmodel", "projectionmodel", "cameratype", "lenstype", "model")
FISHEYE_FLAG = ("fisheyemodel", "isfisheye", "usefisheye")
UNIT = ("unit", "units", "lengthunit", "lengthunits")
FISHEYES = {name for name, model in MODEL_OF.items() if model == "fisheye"} | {"opencv_fisheye", "kannalabrandt"}
UNIT_OF = {
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
}
SHAPES = {
    "left_matrix": (3, 3),
    "right_matrix": (3, 3),
    "left_distortion": (-1,),
    "right_distortion": (-1,),
    "rotation": (3, 3),
    "translation": (3,),
}


def is_file_storage(path: Path, text: str) -> bool:
    """Whether OpenCV wrote this, by its marks or by the file's ending."""
    tagged = any(mark in text for mark in ("opencv-matrix", "opencv-nd-matrix", "<opencv_storage>"))
    return tagged or path.suffix.lower() in (".xml", ".json")


def looks_like(keys: Iterable[str]) -> bool:
    """Whether the names include at least one camera matrix of a stereo pair."""
    return any(_field(key) in ("left_matrix", "right_matrix") for key in keys)


def read(paths: tuple[Path, ...]) -> RawCalibration:
    """Read one file, or the two that share a calibration between them."""
    contents = [_content(path) for path in paths]
    found: dict[str, Any] = {}
    for path, content in zip(paths, contents, strict=True):
        for name, value in _fields(path, content).items():
            if name in found and not np.array_equal(found[name], value):
                raise CalibrationUnreadable(path.name, f"must state {name} once", "two different values")
            found[name] = value
    missing = [f"{name} ({SPELLINGS[name][0].upper()})" for name in SHAPES if name not in found]
    if missing:
        source = " + ".join(path.name for path in paths)
        keys = sorted(key for content in contents for key in content)
        raise CalibrationUnreadable(source, f"must hold {', '.join(missing)}", f"fields {keys}")
    numbers = {name: found[name] for name in SHAPES}
    return RawCalibration(
        **numbers,
        **_size(paths[0], found),
        unit=_unit(contents),
        model=_model(paths[0], contents, found.get("model")),
    )


def read_fisheye(paths: tuple[Path, ...]) -> RawCalibration:
    """Read the same file with its four coefficients as OpenCV's fisheye model, which the file itself must not deny."""
    for path in paths:
        stated = _fields(path, _content(path)).get("model")
        if stated is not None and lens_model(path, stated) == "pinhole":
            rule = "must not be that of a pinhole camera for layout opencv-fisheye"
            raise CalibrationUnreadable(f"{path.name}: distortion_model", rule, stated)
    return replace(read(paths), model="fisheye")


def _plain(key: str) -> str:
    return re.sub(r"[^a-z0-9]", "", key.lower())


def _field(key: str) -> str | None:
    return FIELD_OF.get(_plain(key))


def _said(contents: list[dict[str, Any]], keys: tuple[str, ...]) -> list[str]:
    """Return the words, in lower case, that files say under these keys; numbers are words too."""
    values = [value for content in contents for key, value in content.items() if _plain(key) in keys]
    return [str(value).strip().lower() for value in values]


def _fields(path: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Return what a file holds under our names, as arrays of the right shape."""
    found: dict[str, Any] = {}
    for key, value in content.items():
        name = _field(key)
        if name is None:
            continue
        if name in found:
            raise CalibrationUnreadable(path.name, f"must state {name} once", f"a second one under {key}")
        plain = _value(path, key, value)
        found[name] = matrix(path, key, plain, SHAPES[name]) if name in SHAPES else plain
    return found


def _content(path: Path) -> dict[str, Any]:
    """Return the top level of a file in any of the three formats."""
    text = read_text(path)
    try:
        if text.lstrip().startswith("<"):
            return parse_opencv_xml(text)
        content = parse_json(text) if path.suffix.lower() == ".json" else parse_yaml(text)
    except Refused as error:
        raise refusal(path, error) from error
    if not isinstance(content, dict):
        raise CalibrationUnreadable(path.name, "must be a mapping of names to values", type(content).__name__)
    return content


def _value(path: Path, key: str, value: Any) -> Any:
    """Return the numbers of what OpenCV stores as a matrix or, in XML, as words; other values as they are."""
    if isinstance(value, str) and len(value.split()) > 1:
        return value.split()
    if not isinstance(value, dict):
        return value
    rows_and_columns = value.get("sizes") or [value.get("rows"), value.get("cols")]
    channels = re.match(r"\d*", str(value.get("dt", "")))
    data = _value(path, key, value.get("data"))
    count = math.prod(matrix(path, key, [rows_and_columns], (-1,)).tolist()) * int((channels and channels[0]) or 1)
    flat = np.ravel(np.asarray(data, dtype=object))
    if flat.size != count:
        raise CalibrationUnreadable(f"{path.name}: {key}", f"must hold {count:g} numbers, as it states", flat.size)
    return data


def _model(path: Path, contents: list[dict[str, Any]], stated: Any) -> CameraModel:
    """Return the lens model that files state in any of the ways in use, a pinhole camera where they state none."""
    model = "pinhole" if stated is None else lens_model(path, stated)
    named = any(word in FISHEYES for word in _said(contents, CAMERA))
    flagged = any(word in ("1", "1.", "1.0", "true", "yes", "on") for word in _said(contents, FISHEYE_FLAG))
    if not (named or flagged):
        return model
    if stated is not None and model == "pinhole":
        rule = "must not be a pinhole camera's where the file calls the lens a fisheye elsewhere"
        raise CalibrationUnreadable(f"{path.name}: distortion_model", rule, stated)
    return "fisheye"


def _unit(contents: list[dict[str, Any]]) -> str:
    """Return the unit that the files state, mm where they state none; `finish` refuses one that is not known."""
    words = [UNIT_OF.get(word, word) for word in _said(contents, UNIT)]
    return words[0] if words else "mm"


def _size(path: Path, found: dict[str, Any]) -> dict[str, Any]:
    """Return the size, and whether its sides may be swapped, as `RawCalibration` takes them."""
    named = array = None
    if "width" in found and "height" in found:
        named = picture_size(path, found["width"], found["height"])
    given = found.get("size", found.get("some_size") if named is None else None)
    if given is not None:
        sides = matrix(path, "size", given, (-1,))
        if sides.size != 2:
            raise CalibrationUnreadable(f"{path.name}: size", "must be two numbers", given)
        array = picture_size(path, sides[0], sides[1])
    if named is None:
        return {"size": array, "size_may_be_swapped": array is not None}
    if array not in (None, named, named[::-1]):
        rule = f"must be that of width and height, {named[0]} x {named[1]}"
        raise CalibrationUnreadable(f"{path.name}: size", rule, array)
    return {"size": named, "size_may_be_swapped": False}
