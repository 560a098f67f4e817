"""Disparity maps that lie in a folder, as a method: what any other program has computed can be scored."""

from __future__ import annotations

import io
import tokenize
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.datasets.dataset import Sample, read_disparity
from endosdk.datasets.layouts.pfm import read_pfm
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import Answer, Method
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.file_hash import files_sha256
from endosdk.io.picture_bytes import LARGEST_FILE

FORMATS = (".png", ".pfm", ".npy")


def maps_method(folder: Path) -> Method:
    """Return the method that reads its answers from ``folder``: one file, named for the id of the sample.

    ``ID.png`` holds 16 bits of 256 times the disparity in px, 0: no answer, as in KITTI. ``ID.pfm`` and ``ID.npy`` hold
    the disparity in px as floats, not finite: no answer. Maps [H, W] are as large as the left view. The method raises
    InvalidArgument for a map that is missing, there twice or of another size, DatasetInvalid for a PNG or PFM that
    cannot be read.
    """

    def answer(sample: Sample) -> Answer:
        path = map_file(folder, sample.id)
        disparity = _read(path)
        if disparity.shape != sample.left.shape[:2]:
            rule = f"must be as large as the left view {sample.left.shape[:2]}; {path.name} is not"
            raise InvalidArgument("maps", rule, disparity.shape)
        return Answer(disparity)

    return answer


def map_file(folder: Path, sample_id: str) -> Path:
    """Return the file that holds the map of a sample. Raises InvalidArgument unless there is one, and only one."""
    named = [folder / f"{sample_id}{ending}" for ending in FORMATS]
    found = [path for path in named if path.exists()]
    if len(found) != 1:
        rule = f"must hold one file for each pair, here {sample_id} with one of {', '.join(FORMATS)}"
        raise InvalidArgument("maps", rule, ", ".join(path.name for path in found) or f"none in {folder}")
    return found[0]


def maps_sha256(folder: Path, ids: Sequence[str]) -> str:
    """Return the hash over the names and contents of the maps of these samples."""
    return files_sha256((path.name, path) for path in (map_file(folder, sample_id) for sample_id in ids))


def _read(path: Path) -> npt.NDArray[np.float32]:
    if path.suffix == ".png":
        return read_disparity(path)
    if path.suffix == ".pfm":
        return read_pfm(path)
    try:
        values = np.load(io.BytesIO(read_bounded(path, LARGEST_FILE)), allow_pickle=False)
    except Refused as error:
        raise InvalidArgument("maps", f"{path.name} {error.rule}", f"{error.value} in {path}") from error
    except (ValueError, EOFError, MemoryError, SyntaxError, tokenize.TokenError) as error:
        raise InvalidArgument("maps", "must be readable .npy files", f"{path} ({error})") from error
    if not isinstance(values, np.ndarray) or values.ndim != 2 or not np.issubdtype(values.dtype, np.floating):
        found = f"{getattr(values, 'dtype', type(values).__name__)} {getattr(values, 'shape', '')} in {path}"
        raise InvalidArgument("maps", "must be float arrays [H, W] in .npy files", found)
    return values.astype(np.float32)
