"""Read frames from picture files, and write pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import Refused
from endosdk.io.names import file_name
from endosdk.io.picture_bytes import read_picture
from endosdk.io.whole_files import whole_file

BITS = (10, 12, 16)
# Of a 16-bit picture of disparities, per px, as KITTI has it; 0 is no disparity.
DISPARITY_STEPS = 256.0
LARGEST_DISPARITY = 65535 / DISPARITY_STEPS


def check_bits(bits: int | None) -> int | None:
    """Return how many of its 16 bits a picture uses, None where it has 8. Raises InvalidArgument for any other."""
    if bits is not None and (not isinstance(bits, int) or bits not in BITS):
        raise InvalidArgument("bits", f"must be one of {', '.join(map(str, BITS))}", repr(bits))
    return bits


def read_frame(path: str | Path, *, bits: int | None = None) -> npt.NDArray[np.uint8]:
    """Read a picture file as RGB uint8 [H, W, 3].

    A file of 16 bits per channel does not say how many of them its camera used. ``bits`` does: 10, 12 or 16. The
    largest value of so many bits becomes 255, and all others are rounded to the nearest of 256 steps. Raises
    InvalidArgument where ``path`` is no file name, where the file is damaged, cut off or no picture, where it has 16
    bits and ``bits`` is not given, or 8 and it is, and where a value does not fit into ``bits``.
    """
    import cv2

    check_bits(bits)
    path = file_name("path", path)
    try:
        # As deep as it is stored: OpenCV would otherwise cut 16 bits to 8, and with them most of a 12-bit camera's.
        picture = read_picture(path, "IMREAD_COLOR|IMREAD_ANYDEPTH")
    except Refused as error:
        raise InvalidArgument("frame", error.rule, f"{error.value}: {str(path)!r}") from error
    if bits is not None:
        picture = _eight_bits(picture, bits, path)
    elif picture.dtype != np.uint8:
        rule = "must have 8 bits per channel"
        if picture.dtype == np.uint16:
            rule += "; say how many of the 16 are used, 10, 12 or 16, by bits=, or --bits on the command line"
        raise InvalidArgument("frame", rule, f"{picture.dtype} in {str(path)!r}")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _eight_bits(picture: npt.NDArray[Any], bits: int, path: Path) -> npt.NDArray[np.uint8]:
    if picture.dtype != np.uint16:
        raise InvalidArgument("bits", "is for pictures of 16 bits per channel", f"{picture.dtype} in {str(path)!r}")
    largest = (1 << bits) - 1
    if picture.max() > largest:
        rule = f"must have values up to {largest}, as {bits} bits hold"
        raise InvalidArgument("frame", rule, f"{picture.max()} in {str(path)!r}")
    return ((picture.astype(np.uint32) * 255 + largest // 2) // largest).astype(np.uint8)


def write_picture(path: Path, picture: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> None:
    """Write an RGB or single-channel picture, 8 or 16 bit, whole or not at all; the name's ending is the format."""
    import cv2

    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if picture.ndim == 3 else picture
    try:
        done, data = cv2.imencode(path.suffix, bgr)
    except cv2.error as error:
        raise InvalidArgument("out", "must have the ending of a picture", repr(path.suffix)) from error
    if not done:
        raise InvalidArgument("out", "must be a picture that this format can hold", f"{picture.dtype} {picture.shape}")
    with whole_file(path, "out") as stream:
        stream.write(data.tobytes())
