"""Portable float maps: a header in text, then float32 rows from the bottom up."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endosdk.errors import DatasetInvalid
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.picture_bytes import LARGEST_FILE

_HEADER = re.compile(rb"Pf\s+(\d{1,9})\s+(\d{1,9})\s+(-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s")


def read_pfm(path: Path) -> NDArray[np.float32]:
    """Read a map of one channel as float32 [H, W], top row first. Raises DatasetInvalid when it is none."""
    try:
        data = read_bounded(path, LARGEST_FILE)
    except Refused as error:
        raise DatasetInvalid("sample", f"{path.name} {error.rule}", f"{error.value} in {path}") from error
    header = _HEADER.match(data)
    if header is None:
        raise DatasetInvalid("sample", f"{path.name} must be a PFM of one channel", data[:16])
    width, height, scale = int(header[1]), int(header[2]), float(header[3])
    body = data[header.end() :]
    if len(body) != 4 * width * height:
        raise DatasetInvalid("sample", f"{path.name} must hold {height} x {width} numbers", f"{len(body)} bytes")
    # A negative scale says that the bytes are little-endian.
    values = np.frombuffer(body, "<f4" if scale < 0 else ">f4").reshape(height, width)
    return np.ascontiguousarray(values[::-1].astype(np.float32))
