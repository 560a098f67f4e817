"""Model files: find the shipped ones, read and hash their bytes, understand what they say of themselves."""

from __future__ import annotations

import hashlib
import json
import logging
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument, ModelHashMismatch, ModelMetadata, ModelNotFound, ModelUnreadable
from endosdk.io.bounded_read import is_there
from endosdk.io.names import RULE, is_plain_name

FORMAT_VERSION = "1"
PREFIX = "endosdk."


@dataclass(frozen=True)
class ModelFile:
    """The bytes of one model, with where they came from and their SHA-256."""

    data: bytes = field(repr=False)
    origin: str
    sha256: str


@dataclass(frozen=True)
class ModelInfo:
    """What a model file says of itself (its ``endosdk.*`` metadata), and the SHA-256 of its bytes."""

    name: str
    version: str
    input_multiple: int  # both sides of the input are padded to a multiple of this, px
    output_stride: int  # the output grid is the input grid divided by this
    max_disparity: int  # px at the input width; larger disparities cannot be found
    max_candidate_disparity: int | None  # the largest disparity the network has a plane for, px; None: not stated
    inference_width: (
        int | None
    )  # wider frames are seen at this width unless the caller sets a size, px; None: none named
    channel_order: str
    license: str
    training: dict[str, Any]  # data set ids and hashes, recipe, metrics on the test split
    intended_use: str
    sha256: str


def shipped_models() -> dict[str, Path]:
    """Name and file of every model that came with the package."""
    folder = _shipped_folder()
    return {name: folder / entry["file"] for name, entry in _manifest(folder).items()}


def shipped_weights() -> dict[str, Path]:
    """Name and file of the trained weights that came with the package, from which a training run may start."""
    folder = _shipped_folder()
    return {name: folder / entry["weights"] for name, entry in _manifest(folder).items() if "weights" in entry}


def read_model(source: str | Path | bytes, *, integer_units: bool = True) -> ModelFile:
    """Read a model given by shipped name, path or content.

    A shipped model is checked against its recorded SHA-256; hash and content are of the very bytes that are returned.
    Where there are no ``integer_units``, a shipped model of 8-bit integers gives way to its float twin, with a warning
    in the log ``endosdk``; paths and bytes are always taken as they are.
    """
    if isinstance(source, bytes | bytearray | memoryview):
        data = bytes(source)
        return ModelFile(data, "<bytes>", hashlib.sha256(data).hexdigest())
    if not isinstance(source, str | Path):
        raise InvalidArgument("model", "must be a shipped name, a path or bytes", type(source).__name__)
    folder = _shipped_folder()
    entry = _manifest(folder).get(source) if isinstance(source, str) else None
    if entry and not integer_units and "without_integer_units" in entry:
        twin = entry["without_integer_units"]
        logging.getLogger("endosdk").warning(
            "%s computes in 8-bit integers, for which there are no fast instructions here: %s is used", source, twin
        )
        return read_model(twin)
    path = folder / entry["file"] if entry else Path(source)
    if not (is_there(path) and path.is_file()):
        names = ", ".join(sorted(_manifest(folder)))
        raise ModelNotFound("model", f"must be a file or one of the shipped names ({names})", repr(str(source)))
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if entry and digest != entry["sha256"]:
        raise ModelHashMismatch("model", f"{source} must have SHA-256 {entry['sha256']}", digest)
    return ModelFile(data, str(path), digest)


def parse_metadata(metadata: Mapping[str, str], sha256: str) -> ModelInfo:
    """Turn the metadata of an ONNX file into a `ModelInfo`; name the key that is missing or wrong."""
    version = _required(metadata, "format_version")
    if version != FORMAT_VERSION:
        raise ModelMetadata("format_version", f"this release reads format {FORMAT_VERSION}", repr(version))
    order = _required(metadata, "channel_order")
    if order != "rgb":
        raise ModelMetadata("channel_order", "must be rgb", repr(order))
    try:
        training = json.loads(_required(metadata, "training"))
    except (ValueError, RecursionError) as error:
        raise ModelMetadata(PREFIX + "training", "must be JSON", str(error)) from error
    if not isinstance(training, dict):
        raise ModelMetadata(PREFIX + "training", "must be a JSON object", type(training).__name__)
    max_disparity = _positive(metadata, "max_disparity")
    max_candidate_disparity = _optional(metadata, "max_candidate_disparity")
    if max_candidate_disparity is not None and max_candidate_disparity > max_disparity:
        raise ModelMetadata(
            PREFIX + "max_candidate_disparity",
            f"must be at most max_disparity, {max_disparity}",
            max_candidate_disparity,
        )
    return ModelInfo(
        name=_plain(metadata, "name"),
        version=_required(metadata, "version"),
        input_multiple=_positive(metadata, "input_multiple"),
        output_stride=_positive(metadata, "output_stride"),
        max_disparity=max_disparity,
        max_candidate_disparity=max_candidate_disparity,
        inference_width=_optional(metadata, "inference_width"),
        channel_order=order,
        license=_required(metadata, "license"),
        training=training,
        intended_use=_required(metadata, "intended_use"),
        sha256=sha256,
    )


def _shipped_folder() -> Path:
    # Copied into a wheel; a link to the repository's models/ in an editable install.
    return Path(__file__).parents[1] / "_models"


def _manifest(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / "models.toml"
    if not path.is_file():
        raise ModelUnreadable("models.toml", "the installed package must contain its model list", str(path))
    return tomllib.loads(path.read_text())


def _required(metadata: Mapping[str, str], key: str) -> str:
    value = metadata.get(PREFIX + key)
    if value is None or value == "":
        raise ModelMetadata(PREFIX + key, "a model for endosdk must carry this metadata key", "nothing")
    return value


def _plain(metadata: Mapping[str, str], key: str) -> str:
    """Return a name that may become that of a folder."""
    name = _required(metadata, key)
    if not is_plain_name(name):
        raise ModelMetadata(PREFIX + key, RULE, repr(name))
    return name


def _positive(metadata: Mapping[str, str], key: str) -> int:
    text = _required(metadata, key)
    # Nine digits: more than any side or disparity has, and few enough for every integer type of the library.
    if not re.fullmatch("[0-9]{1,9}", text) or int(text) == 0:
        raise ModelMetadata(PREFIX + key, "must be a positive whole number", repr(text))
    return int(text)


def _optional(metadata: Mapping[str, str], key: str) -> int | None:
    return _positive(metadata, key) if PREFIX + key in metadata else None
