"""Model files: find the shipped ones, read and hash their bytes, understand what they say of themselves."""

from __future__ import annotations

import hashlib
import json
import logging
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from endosdk import _core
from endosdk.errors import InvalidArgument, ModelHashMismatch, ModelMetadata, ModelNotFound, ModelUnreadable
from endosdk.io.bounded_read import Refused, is_there, read_bounded

LARGEST_MODEL = 2**31  # bytes; a file of ONNX can hold no more


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
    max_disparity: int  # length of the disparity axis, px at the input width
    max_candidate_disparity: int | None  # the largest disparity the network considers, px; None: not stated
    inference_width: int | None  # px; frames are seen at this width unless the caller sets a size; None: any
    upsampling: str  # how disparity comes to the input's grid; what the network was trained through
    channel_order: str
    license: str
    training: dict[str, Any]  # data set ids and hashes, recipe, metrics on the test split
    intended_use: str
    sha256: str

    def identity(self) -> dict[str, str]:
        """Return what tells this model from every other: name, version and sha256, as JSON values."""
        return {"name": self.name, "version": self.version, "sha256": self.sha256}


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

    A shipped model is checked against its recorded SHA-256, any other against the seal inside it. One without a seal is
    taken with a warning in the log ``endosdk``. Hash and content are of the very bytes returned.
    Without ``integer_units``, a shipped model of 8-bit integers gives way to its float32 model, with a warning in the
    log ``endosdk``; paths and bytes are always taken as they are.
    """
    if isinstance(source, bytes | bytearray | memoryview):
        return _unpinned(bytes(source), "<memory>")
    if not isinstance(source, str | Path):
        raise InvalidArgument("model", "must be a shipped name, a path or bytes", type(source).__name__)
    folder = _shipped_folder()
    entry = _manifest(folder).get(source) if isinstance(source, str) else None
    if entry and not integer_units and "without_integer_units" in entry:
        float32_model = entry["without_integer_units"]
        logging.getLogger("endosdk").warning(
            "%s computes in 8-bit integers, which are not fast here: %s is used", source, float32_model
        )
        return read_model(float32_model)
    path = folder / entry["file"] if entry else Path(source)
    if not (is_there(path) and path.is_file()):
        names = ", ".join(sorted(_manifest(folder)))
        raise ModelNotFound("model", f"must be a file or one of the shipped names ({names})", repr(str(source)))
    try:
        data = read_bounded(path, LARGEST_MODEL)
    except Refused as refused:
        raise ModelUnreadable("model", f"{path} {refused.rule}", refused.value) from refused
    if entry is None:
        return _unpinned(data, str(path))
    digest = hashlib.sha256(data).hexdigest()
    if digest != entry["sha256"]:
        raise ModelHashMismatch("model", f"{source} must have SHA-256 {entry['sha256']}", digest)
    return ModelFile(data, str(path), digest)


def _unpinned(data: bytes, origin: str) -> ModelFile:
    """Return a model whose hash nobody has stated; only its seal can tell that it is whole."""
    if not _core.check_seal(data, origin):
        logging.getLogger("endosdk").warning(
            "%s carries no seal: damage to its weights would not be noticed; export it with this release", origin
        )
    return ModelFile(data, origin, hashlib.sha256(data).hexdigest())


def parse_metadata(metadata: Mapping[str, str], sha256: str) -> ModelInfo:
    """Turn the metadata of an ONNX file into a `ModelInfo`; name the key that is missing or wrong."""
    fields = _core.parse_metadata(dict(metadata), sha256)
    try:
        fields["training"] = json.loads(fields["training"])
    except (ValueError, RecursionError) as error:
        raise ModelMetadata(_core.model_key_prefix + "training", "must be JSON", error) from error
    return ModelInfo(**fields)


def _shipped_folder() -> Path:
    # Copied into a wheel; a link to the repository's models/ in an editable install.
    return Path(__file__).parents[1] / "_models"


def _manifest(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / "models.toml"
    if not path.is_file():
        raise ModelUnreadable("models.toml", "the installed package must contain its model list", str(path))
    return tomllib.loads(path.read_text())
