"""The hashes by which a recording knows its pictures, and its lines, which hold the hashes of the pictures."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt


def hash_of_picture(picture: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> str:
    """Return the SHA-256 of a picture's values, row by row."""
    return hashlib.sha256(np.ascontiguousarray(picture).data).hexdigest()


def hash_of_lines(lines: Sequence[str]) -> str:
    """Return the SHA-256 of all lines."""
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
