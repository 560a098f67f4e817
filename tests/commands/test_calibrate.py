"""``endosdk calibrate`` as typed: summaries, files written, and one clear line for every mistake."""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from endosdk import DepthEstimator
from endosdk.calibration.boards import Board
from endosdk.calibration.rig import StereoCalibration
from endosdk.commands.cli import main
from endosdk.io.pictures import read_frame
from endosdk.runtime.models import shipped_models
from tests.rigs import raw_rig


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    raw_rig().save(tmp_path / "rig.json")
    return tmp_path / "rig.json"


def test_convert_prints_what_a_person_checks(rig_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "convert", str(rig_file)]) == 0
    shown = capsys.readouterr().out
    for part in (
        "640x480",
        "focal 520.5 x 521.8 px",
        "baseline    4.612 mm",
        "rotated by 1.51 degrees",
        "to be rectified",
    ):
        assert part in shown
    assert raw_rig().sha256 in shown and "written" not in shown


def test_convert_and_doctor_say_how_near_each_model_sees(rig_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["calibrate", "convert", str(rig_file)], ["doctor", "--calibration", str(rig_file)]):
        assert main(words) == 0
        shown = capsys.readouterr().out.splitlines()
        rows = shown[shown.index("nearest     depth of each model on this rig:") + 1 :]
        for name, row in zip(shipped_models(), rows, strict=False):
            nearest = DepthEstimator(name, calibration=StereoCalibration.load(rig_file)).nearest_depth_mm
            assert nearest is not None and row.split() == [name, str(math.ceil(nearest)), "mm"]


@pytest.mark.parametrize("marker", [[], ["--charuco", "2.2"]], ids=["chessboard", "charuco"])
def test_a_printed_board_has_its_true_size(tmp_path: Path, marker: list[str]) -> None:
    words = ["calibrate", "print", "--pattern", "9x6", "--square-mm", "3.04", *marker]
    assert main([*words, "--out", str(tmp_path / "board.png")]) == 0
    data = (tmp_path / "board.png").read_bytes()
    at = data.index(b"pHYs") + 4
    across, down, unit = struct.unpack(">IIB", data[at : at + 9])
    assert across == down and unit == 1  # pixels per metre
    board = Board((9, 6), 3.04, float(marker[1]) if marker else None)
    found = board.find(read_frame(tmp_path / "board.png"))
    assert len(found) == 54
    length = float(np.linalg.norm(found[8] - found[0])) * 1000 / across
    assert length == pytest.approx(8 * 3.04, abs=0.02)


def test_a_board_is_written_as_png_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", "print", "--pattern", "9x6", "--square-mm", "3", "--out", str(tmp_path / "board.jpg")]
    assert main(words) == 2
    assert "must be a file that ends in .png" in capsys.readouterr().err


def test_convert_says_so_where_no_runtime_is(
    rig_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert main(["calibrate", "convert", str(rig_file)]) == 0
    shown = capsys.readouterr().out
    assert "depth of the shipped models is not known" in shown and "sha256" in shown


def test_convert_writes_our_file_from_another_layout(tmp_path: Path) -> None:
    (tmp_path / "K.txt").write_text("700.5 0 319.5 0 700.5 239.5 0 0 1\n0.0042\n")
    out = tmp_path / "out.json"
    words = ["calibrate", "convert", str(tmp_path / "K.txt"), "--size", "640x480"]
    assert main([*words, "--units", "m", "--layout", "foundationstereo", "--out", str(out)]) == 0
    rig = StereoCalibration.load(out)
    assert rig.is_rectified and rig.baseline_mm == pytest.approx(4.2)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["missing.json"], "that exists"),
        (["{rig}", "--size", "320x240"], "size: must agree with rig.json"),
        (["{rig}", "--size", "big"], "WIDTHxHEIGHT"),
        (["{rig}", "--layout", "matlab"], "layout: must be one of"),
        (["{rig}", "--out", "{rig}/rig.json"], "out: the folder must be writable"),
        (["{rig}", "{rig}"], "one file"),
    ],
)
def test_convert_says_in_one_line_what_is_wrong(
    rig_file: Path, words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word.format(rig=rig_file, folder=rig_file.parent) for word in words]
    assert main(["calibrate", "convert", *given]) == 2
    error = capsys.readouterr().err
    assert line in error and error.startswith("endosdk calibrate: ") and error.count("\n") == 1


def test_names_that_are_no_utf_8_are_printed_as_escapes(rig_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = os.fsdecode(os.fsencode(rig_file.parent) + b"/r\xff.json")
    assert main(["calibrate", "convert", str(rig_file), "--out", out]) == 0
    assert Path(out).exists() and "/r\\udcff.json" in capsys.readouterr().out


def picture_folder(folder: Path, *names: str, size: tuple[int, int] = (60, 80)) -> Path:
    import cv2

    folder.mkdir()
    for name in names:
        cv2.imwrite(str(folder / name), np.full((*size, 3), 128, np.uint8))
    return folder


def test_pictures_without_a_board_are_skipped_and_too_few_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = picture_folder(tmp_path / "l", "1.png"), picture_folder(tmp_path / "r", "1.png")
    words = ["calibrate", "board", str(left), str(right), "--pattern", "9x6", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 2
    error = capsys.readouterr().err
    assert "left out    1.png, 1.png: no whole board" in error and "pairs: must be at least 3" in error
    assert not (tmp_path / "rig.json").exists()


def test_boards_may_come_as_bare_pixels_on_standard_input(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "endosdk", "calibrate", "board", "-", "--raw", "gray:64x32", "--pattern", "5x4"]
    words += ["--square-mm", "2", "--out", str(tmp_path / "rig.json")]
    done = subprocess.run(words, input=bytes(3 * 64 * 32), capture_output=True, check=False)
    assert done.returncode == 2
    assert b"left out    3 frames: no whole board in either view" in done.stderr


def test_a_picture_that_cannot_be_read_ends_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left = picture_folder(tmp_path / "l", "1.png", "2.png")
    right = picture_folder(tmp_path / "r", "1.png", "2.png")
    (left / "1.png").write_bytes(b"no picture")
    words = ["calibrate", "board", str(left), str(right), "--pattern", "9x6", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 2
    error = capsys.readouterr().err
    assert "left out    1.png, 1.png: frame: must be a picture (PNG," in error
    assert "left out    2.png, 2.png: no whole board" in error


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("--views", "5"), ("--gap", "4"), ("--layout", "rows"), ("--raw", "gray:64x32")),
        *(("--queue", "newest"), ("--scan", "progressive"), ("--rate", "30")),
    ],
)
@pytest.mark.parametrize("together", [False, True])
def test_folders_refuse_what_is_of_a_video(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, together: bool
) -> None:
    folders = [str(picture_folder(tmp_path / side, "1.png")) for side in ("left", "right")]
    words = ["calibrate", "board", *([str(tmp_path)] if together else folders), "--pattern", "9x6", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json"), option, value]) == 2
    assert f"{option[2:]}: is of a video or a camera; leave it out with folders" in capsys.readouterr().err


def test_too_few_views_are_refused_before_they_are_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", "board", "film.mp4", "--pattern", "9x6", "--square-mm", "3", "--views", "2"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 2
    assert "views: must be at least 3; got 2" in capsys.readouterr().err


def test_a_wrong_pattern_is_called_a_pattern(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left = picture_folder(tmp_path / "l", "1.png")
    words = ["calibrate", "board", str(left), str(left), "--pattern", "9", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 2
    assert "pattern: must be COLUMNSxROWS of inner corners" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "begins"), [("rig.yaml", "format:"), ("rig.YML", "format:"), ("rig.json", "{")])
def test_the_name_of_the_file_chooses_its_form(tmp_path: Path, rig_file: Path, name: str, begins: str) -> None:
    out = tmp_path / "new" / name
    out.parent.mkdir()
    assert main(["calibrate", "convert", str(rig_file), "--out", str(out)]) == 0
    assert out.read_text().startswith(begins)
    assert StereoCalibration.load(out) == raw_rig()
    assert StereoCalibration.load(out).sha256 == raw_rig().sha256


def test_a_pair_of_another_size_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left = picture_folder(tmp_path / "l", "1.png")
    right = picture_folder(tmp_path / "r", "1.png", size=(50, 80))
    words = ["calibrate", "board", str(left), str(right), "--pattern", "9x6", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 2
    assert "; the first image has (80, 60)" in capsys.readouterr().err


def test_a_name_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, rig_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere = [str(tmp_path / "left"), str(tmp_path / "right")]  # which would be an error, too
    board = ["calibrate", "board", *nowhere, "--pattern", "9x6", "--square-mm", "2"]
    for words in (board, ["calibrate", "refine", str(rig_file), nowhere[0]], ["calibrate", "convert", str(rig_file)]):
        assert main([*words, "--out", str(tmp_path / "rig.txt")]) == 2
        assert "out: must end in one of .json, .yaml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (["--pattern", "100x100", "--square-mm", "3", "--charuco", "2"], "dictionary: must have 5100 markers"),
        (["--pattern", "14x10", "--square-mm", "3000"], "square_mm: must give an image of at most 16384 px"),
    ],
)
def test_a_board_that_cannot_be_drawn_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], rule: str
) -> None:
    assert main(["calibrate", "print", *words, "--out", str(tmp_path / "board.png")]) == 2
    assert rule in capsys.readouterr().err
