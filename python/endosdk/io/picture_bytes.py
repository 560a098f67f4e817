"""Decode a picture that a stranger may have made: known formats, whole files, bounded size.

OpenCV fills what a cut-off file lacks with gray and reports nothing, and reserves whatever size a header claims. So the
container is looked at first.
"""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.io.bounded_read import Refused, read_bounded

LARGEST_FILE = 512 * 1024 * 1024  # bytes
LONGEST_SIDE = 16384  # px
MOST_PIXELS = 100_000_000  # ten times an 8K frame's third; 300 MB of RGB

FORMATS = "PNG, JPEG, BMP, TIFF, PGM or PPM"


def read_picture(path: Path, mode: str) -> npt.NDArray[Any]:
    """Return the pixels of a picture file in OpenCV's order of channels; ``mode`` is one of its ``IMREAD`` names.

    Raises `Refused` where the file is cut off, damaged, larger than any camera's picture, or none of `FORMATS`.
    """
    return decode_picture(read_bounded(path, LARGEST_FILE), mode)


def decode_picture(data: bytes, mode: str) -> npt.NDArray[Any]:
    """Return the pixels of a picture file's content; see `read_picture`."""
    import cv2

    check_picture_size(*_whole_size(data))
    flags = 0
    for name in mode.split("|"):
        flags |= getattr(cv2, name)
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except (cv2.error, MemoryError) as error:
        raise Refused("must be a picture that OpenCV can decode", " ".join(str(error).split())) from error
    if picture is None:
        raise Refused("must be a picture that OpenCV can decode", "damaged content")
    return np.asarray(picture)


def check_picture_size(width: int, height: int) -> None:
    """Raise `Refused` for a size, px, that is no camera's."""
    if not (0 < width <= LONGEST_SIDE and 0 < height <= LONGEST_SIDE and width * height <= MOST_PIXELS):
        raise Refused(f"must have 1 to {LONGEST_SIDE} px a side and at most {MOST_PIXELS} px", f"{width}x{height}")


def _whole_size(data: bytes) -> tuple[int, int]:
    """Return (width, height) as the header states them, of a file that has its end."""
    try:
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return _png_size(data)
        if data.startswith(b"\xff\xd8\xff"):
            return _jpeg_size(data)
        if data.startswith(b"BM"):
            return _bmp_size(data)
        if data[:4] in (b"II*\0", b"MM\0*"):
            return _tiff_size(data)
        if data[:2] in (b"P5", b"P6"):
            return _pnm_size(data)
    except struct.error as error:
        raise Refused("must be a whole picture", "a file that is cut off") from error
    raise Refused(f"must be a picture ({FORMATS})", f"a file that begins with {data[:8]!r}")


def _png_size(data: bytes) -> tuple[int, int]:
    """Walk the chunks: each has its checksum, and the last is IEND."""
    view, at = memoryview(data), 8
    while True:
        length, kind = struct.unpack_from(">I4s", data, at)
        (stated,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(view[at + 4 : at + 8 + length]) != stated:
            raise Refused("must be an undamaged PNG", f"a wrong checksum of {kind!r} at byte {at}")
        if kind == b"IEND":
            break
        at += 12 + length
    width, height = struct.unpack_from(">4x4xII", data, 8)
    return width, height


def _jpeg_size(data: bytes) -> tuple[int, int]:
    """Walk the segments up to the frame header; what follows the last scan's header holds the end mark."""
    if data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise Refused("must be a whole picture", "a JPEG without its end mark")
    at = 2
    while True:
        mark, kind = struct.unpack_from(">BB", data, at)
        if mark != 0xFF:
            raise Refused("must be an undamaged JPEG", f"no segment at byte {at}")
        if kind == 0xFF:  # a fill byte
            at += 1
            continue
        # SOF0 to SOF15, without the tables (C4, CC) and the reserved C8.
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        if kind in (0xD9, 0xDA):
            raise Refused("must be an undamaged JPEG", "pixels before their size")
        standalone = kind == 0x01 or 0xD0 <= kind <= 0xD7
        at += 2 if standalone else 2 + max(2, struct.unpack_from(">H", data, at + 2)[0])


def _bmp_size(data: bytes) -> tuple[int, int]:
    pixels_at, header, width, height = struct.unpack_from("<10xIIii", data)
    if header < 40:
        raise Refused("must be a BMP with a Windows header (40 bytes or more)", f"a header of {header} bytes")
    bits, packing, packed_bytes = struct.unpack_from("<28xHII", data)
    row = (width * bits + 31) // 32 * 4
    needed = row * abs(height) if packing in (0, 3) else packed_bytes
    if len(data) < pixels_at + needed:
        raise Refused("must be a whole picture", "a file that is cut off")
    return width, abs(height)


# Bytes of one value of each TIFF type, and how the whole-number types are read.
_TIFF_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8}
_TIFF_WHOLE = {1: "B", 3: "H", 4: "I"}
_WIDTH, _HEIGHT, _STRIP_AT, _STRIP_BYTES, _TILE_AT, _TILE_BYTES = 256, 257, 273, 279, 324, 325


def _tiff_size(data: bytes) -> tuple[int, int]:
    """Read the first directory: every strip or tile that it names lies inside the file."""
    order = "<" if data[:1] == b"I" else ">"
    (directory,) = struct.unpack_from(order + "4xI", data)
    (count,) = struct.unpack_from(order + "H", data, directory)
    found: dict[int, tuple[int, ...]] = {}
    for entry in range(count):
        at = directory + 2 + 12 * entry
        tag, kind, values = struct.unpack_from(order + "HHI", data, at)
        if kind not in _TIFF_WHOLE or tag not in (_WIDTH, _HEIGHT, _STRIP_AT, _STRIP_BYTES, _TILE_AT, _TILE_BYTES):
            continue
        size = _TIFF_BYTES[kind] * values
        if size > len(data):
            raise Refused("must be a whole picture", "a file that is cut off")
        start = at + 8 if size <= 4 else struct.unpack_from(order + "I", data, at + 8)[0]
        found[tag] = struct.unpack_from(f"{order}{values}{_TIFF_WHOLE[kind]}", data, start)
    starts = found.get(_STRIP_AT, ()) + found.get(_TILE_AT, ())
    lengths = found.get(_STRIP_BYTES, ()) + found.get(_TILE_BYTES, ())
    if not starts or len(starts) != len(lengths) or not (found.get(_WIDTH) and found.get(_HEIGHT)):
        raise Refused("must be an undamaged TIFF", "a directory without size or pixels")
    if any(start + length > len(data) for start, length in zip(starts, lengths, strict=True)):
        raise Refused("must be a whole picture", "a file that is cut off")
    return found[_WIDTH][0], found[_HEIGHT][0]


_PNM = re.compile(rb"P([56])(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,5})\s")


def _pnm_size(data: bytes) -> tuple[int, int]:
    header = _PNM.match(data[:4096])
    if header is None:
        raise Refused("must be an undamaged PGM or PPM", "another header")
    width, height, brightest = (int(number) for number in header.groups()[1:])
    samples = width * height * (3 if header[1] == b"6" else 1)
    if len(data) < header.end() + samples * (2 if brightest > 255 else 1):
        raise Refused("must be a whole picture", "a file that is cut off")
    return width, height
