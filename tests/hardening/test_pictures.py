"""Picture files that are cut off, damaged, oversized or strangely named."""

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.datasets.dataset import read_colours
from endosdk.errors import DatasetInvalid, InvalidArgument, StorageFailed
from endosdk.io.picture_bytes import LONGEST_SIDE, MOST_PIXELS
from endosdk.io.pictures import read_frame, write_picture
from tests.conftest import textured_picture

PICTURE = textured_picture(48, 64)
ENDINGS = [".png", ".jpg", ".bmp", ".tif", ".ppm"]


def encoded(ending: str, picture: np.ndarray = PICTURE) -> bytes:
    bgr = picture[..., ::-1] if picture.ndim == 3 else picture
    done, data = cv2.imencode(ending, np.ascontiguousarray(bgr))
    assert done
    return data.tobytes()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_name_that_is_not_utf8_is_read_and_written(tmp_path: Path, ending: str) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/left-\xff\xfe" + ending.encode()))
    write_picture(path, PICTURE)
    seen = read_frame(path)
    assert np.array_equal(seen, PICTURE) or (ending == ".jpg" and np.abs(seen.astype(int) - PICTURE).mean() < 8)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_picture_is_refused_wherever_it_is_cut_off(tmp_path: Path, ending: str) -> None:
    whole = encoded(ending)
    path = tmp_path / f"left{ending}"
    for length in [*range(0, 64), *range(64, len(whole) - 16, 97), len(whole) - 3]:
        path.write_bytes(whole[:length])
        with pytest.raises(InvalidArgument):
            read_frame(path)
    path.write_bytes(whole)
    assert read_frame(path).shape == PICTURE.shape


def test_every_flipped_byte_of_a_png_is_noticed(tmp_path: Path) -> None:
    whole = encoded(".png")
    path = tmp_path / "left.png"
    for at in [*range(0, 64), *range(64, len(whole), 31)]:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x40]) + whole[at + 1 :])
        with pytest.raises(InvalidArgument):
            read_frame(path)


def png_of(width: int, height: int) -> bytes:
    """A PNG of zeros whose pixels take a thousandth of what they claim."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    row = zlib.compress(b"\0" * 1000)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", row) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    "size", [(0, 10), (LONGEST_SIDE + 1, 10), (10, 2**31 - 1), (2**31 - 1, 2**31 - 1), (16000, 16000)], ids=str
)
def test_an_oversized_picture_is_refused_before_it_is_decoded(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "left.png").write_bytes(png_of(*size))
    with pytest.raises(InvalidArgument, match=f"at most {MOST_PIXELS} px; got {size[0]}x{size[1]}"):
        read_frame(tmp_path / "left.png")


def test_an_oversized_jpeg_bmp_tiff_and_ppm_are_refused(tmp_path: Path) -> None:
    jpeg = bytearray(encoded(".jpg"))
    frame = next(i for i in range(len(jpeg)) if jpeg[i] == 0xFF and jpeg[i + 1] in (0xC0, 0xC2))
    struct.pack_into(">HH", jpeg, frame + 5, 65535, 65535)
    bmp = bytearray(encoded(".bmp"))
    struct.pack_into("<ii", bmp, 18, 2**30, 2**30)
    for name, data in (("a.jpg", bytes(jpeg)), ("b.bmp", bytes(bmp)), ("c.ppm", b"P6 99999999 99999999 255\n")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InvalidArgument):
            read_frame(tmp_path / name)


def test_a_pipe_and_a_device_are_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "left.png")
    for path in (tmp_path / "left.png", Path("/dev/zero"), tmp_path):
        with pytest.raises(InvalidArgument, match=r"regular file|readable"):
            read_frame(path)


def test_a_data_set_refuses_the_same(tmp_path: Path) -> None:
    (tmp_path / "left.png").write_bytes(encoded(".png")[:-20])
    with pytest.raises(DatasetInvalid, match=r"left\.png must be a whole picture"):
        read_colours(tmp_path / "left.png")


def test_a_picture_is_never_written_onto_a_device(tmp_path: Path) -> None:
    (tmp_path / "out.png").symlink_to("/dev/full")
    with pytest.raises(StorageFailed, match="regular file"):
        write_picture(tmp_path / "out.png", PICTURE)


def test_a_picture_without_a_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="ending of a picture"):
        write_picture(tmp_path / "out", PICTURE)
