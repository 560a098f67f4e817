"""Picture files come back as they were written; what would have to be guessed is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.errors import InvalidArgument
from endosdk.io.pictures import read_frame, write_picture
from tests.conftest import TINY_MODEL, shifted_pair


def test_frame_files_come_back_as_rgb(tmp_path: Path) -> None:
    left, _ = shifted_pair(20, 30, 1)
    write_picture(tmp_path / "f.png", left)
    assert np.array_equal(read_frame(tmp_path / "f.png"), left)


def test_broken_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.png").write_bytes(b"no picture")
    with pytest.raises(InvalidArgument, match="must be a picture"):
        read_frame(tmp_path / "x.png")


@pytest.mark.parametrize("path", [None, 5])
def test_what_is_no_file_name_is_refused(path: Any) -> None:
    with pytest.raises(InvalidArgument, match=f"^path: must be a file name; got {path} "):
        read_frame(path)


def test_deep_pictures_are_refused_not_cut(tmp_path: Path) -> None:
    write_picture(tmp_path / "deep.png", np.full((4, 5, 3), 4080, np.uint16))
    rule = r"must have 8 bits per channel; say how many of the 16 are used, 10, 12 or 16, by bits=, or --bits .*uint16"
    with pytest.raises(InvalidArgument, match=rule):
        read_frame(tmp_path / "deep.png")
    cv2.imwrite(str(tmp_path / "float.tif"), np.zeros((4, 5, 3), np.float32))
    for bits in (None, 12):
        with pytest.raises(InvalidArgument, match="got float32"):
            read_frame(tmp_path / "float.tif", bits=bits)


@pytest.mark.parametrize("bits", [10, 12, 16])
@pytest.mark.parametrize("ending", [".png", ".tif", ".ppm"])
def test_deep_pictures_are_rounded_to_8_bits(tmp_path: Path, bits: int, ending: str) -> None:
    rng = np.random.default_rng(bits)
    deep = rng.integers(0, 1 << bits, (40, 50, 3)).astype(np.uint16)
    deep[0, :2] = [[0, 0, 0], [(1 << bits) - 1] * 3]
    write_picture(tmp_path / f"deep{ending}", deep)
    found = read_frame(tmp_path / f"deep{ending}", bits=bits)
    assert found.dtype == np.uint8
    assert np.abs(found - deep / ((1 << bits) - 1) * 255).max() <= 0.5


@pytest.mark.parametrize("bits", [10, 12])
def test_a_value_that_does_not_fit_is_refused_not_cut(tmp_path: Path, bits: int) -> None:
    deep = np.zeros((4, 5, 3), np.uint16)
    deep[2, 3, 1] = 1 << bits
    write_picture(tmp_path / "deep.png", deep)
    rule = f"frame: must have values up to {(1 << bits) - 1}, as {bits} bits hold; got {1 << bits} in .*deep.png"
    with pytest.raises(InvalidArgument, match=rule):
        read_frame(tmp_path / "deep.png", bits=bits)


@pytest.mark.parametrize("bits", [8, 14, 12.0, True, "12"])
def test_other_bits_are_refused(tmp_path: Path, bits: object) -> None:
    with pytest.raises(InvalidArgument, match="bits: must be one of 10, 12, 16; got"):
        read_frame(tmp_path / "none.png", bits=bits)


def test_a_picture_of_8_bits_needs_none(tmp_path: Path) -> None:
    write_picture(tmp_path / "f.png", shifted_pair(20, 30, 1)[0])
    with pytest.raises(InvalidArgument, match=r"bits: is for pictures of 16 bits per channel; got uint8 in .*f\.png"):
        read_frame(tmp_path / "f.png", bits=12)


def test_predict_takes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = []
    for name, view in zip(("l.png", "r.tif"), shifted_pair(96, 160, 12), strict=True):
        write_picture(tmp_path / name, view.astype(np.uint16) * 4)
        paths.append(str(tmp_path / name))
    words = ["predict", *paths, "--model", str(TINY_MODEL), "--frames", "0", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "--bits" in capsys.readouterr().err
    assert main([*words, "--bits", "10"]) == 0
    disparity = cv2.imread(str(tmp_path / "out" / "disparity.png"), cv2.IMREAD_UNCHANGED)
    assert np.median(disparity[8:-8, 56:-8]) / 256 == pytest.approx(12, abs=0.1)
