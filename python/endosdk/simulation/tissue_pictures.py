"""Pictures of real tissue that a user brings, as the colours of rendered surfaces."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.picture_bytes import LARGEST_FILE, decode_picture
from endosdk.io.picture_pairs import ENDINGS
from endosdk.simulation.noise import Array

SMALLEST_SIDE = 64  # px
PICTURE_MM = 40.0  # the longer side of a picture covers so much tissue: more than any baseline, so no repeat matches
LAMP_SHARE = 0.2  # what changes over more than this share of the longer side is taken for the lamp of the picture


@dataclass(frozen=True)
class TissuePicture:
    """A picture file, and the SHA-256 of its bytes when it was found."""

    file: str
    sha256: str

    @property
    def described(self) -> dict[str, str]:
        """Say which picture it is, without where it lies."""
        return {"name": Path(self.file).name, "sha256": self.sha256}


def find_pictures(folder: Path) -> tuple[TissuePicture, ...]:
    """Return all pictures of a folder. Raises InvalidArgument when there is none, or one that cannot be used."""
    if not folder.is_dir():
        raise InvalidArgument("textures", "must be a folder with pictures of tissue", folder)
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not files:
        raise InvalidArgument("textures", f"must hold pictures ({', '.join(ENDINGS)})", folder)
    return tuple(TissuePicture(str(file.resolve()), hashlib.sha256(_bytes(file)).hexdigest()) for file in files)


def tissue_tile(picture: TissuePicture, rng: np.random.Generator, shape: tuple[int, int], scale: float) -> Array:
    """Return linear colours [H, W, 3], 0..1, for a surface of ``scale`` px a mm: the picture, mirrored again and again.

    The light of the lamp that lit it is divided out, as far as it changes slowly.
    """
    import cv2

    colours = _evenly_lit(picture)
    factor = PICTURE_MM * scale / max(colours.shape[:2])
    size = tuple(max(2, round(side * factor)) for side in colours.shape[1::-1])
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.resize(colours, size, interpolation=method), np.float32)
    rows, columns = (_there_and_back(rng, length, side) for length, side in zip(shape, tile.shape[:2], strict=True))
    return np.ascontiguousarray(tile[rows][:, columns])


def _there_and_back(rng: np.random.Generator, length: int, side: int) -> NDArray[np.int64]:
    """Return places 0..side-1 that run to the end and back again, from a drawn start: no seam anywhere."""
    place = (np.arange(length) + int(rng.integers(2 * side))) % (2 * side)
    return np.minimum(place, 2 * side - 1 - place)


@lru_cache(maxsize=8)
def _evenly_lit(picture: TissuePicture) -> Array:
    import cv2

    data = _bytes(Path(picture.file))
    if hashlib.sha256(data).hexdigest() != picture.sha256:
        raise InvalidArgument("textures", "must stay as they are while a set is rendered", picture.file)
    linear = ((decode_picture(data, "IMREAD_COLOR")[..., ::-1] / np.float32(255)) ** np.float32(2.2)).astype(np.float32)
    lamp = cv2.GaussianBlur(linear.mean(axis=2), (0, 0), LAMP_SHARE * max(linear.shape[:2]))
    even = linear * (lamp.mean() / np.maximum(lamp, 1e-3))[..., None]
    return np.asarray(np.clip(even, 0.0, 1.0), np.float32)


def _bytes(file: Path) -> bytes:
    """Return the content of a picture that can be used."""
    try:
        data = read_bounded(file, LARGEST_FILE)
        height, width = decode_picture(data, "IMREAD_COLOR").shape[:2]
    except Refused as error:
        raise InvalidArgument("textures", f"{file.name} {error.rule}", error.value) from error
    if min(height, width) < SMALLEST_SIDE:
        rule = f"{file.name} must have at least {SMALLEST_SIDE} px a side"
        raise InvalidArgument("textures", rule, f"{width}x{height}")
    return data
