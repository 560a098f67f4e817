"""Real chessboard pairs: a given calibration must make rows agree and give lengths in mm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.accuracy.chessboard import SIZE, measure, read_corners
from endosdk.calibration.board import row_correlation
from endosdk.calibration.rig import StereoCalibration
from endosdk.commands.cli import main
from endosdk.io.pictures import read_frame

# Pairs closer than this are at an endoscope's working distance; at 250 mm one corner's noise moves depth by 2 %.
NEAR_MM = 150


@pytest.fixture(scope="module")
def board(shared_data: Path) -> Path:
    folder = shared_data / "chessboard"
    if not folder.is_dir():
        pytest.skip("no chessboard pairs here: name the folder that holds them in ENDOSDK_SHARED_DATA")
    return folder


@pytest.fixture(scope="module")
def measured(board: Path) -> dict[str, Any]:
    return measure(board)


def test_rows_agree_after_rectification(measured: dict[str, Any]) -> None:
    rows, before = measured["row_difference_px"], measured["row_difference_before_px"]
    print(f"rows differ by {rows['median']:.3f} px (median), {rows['p95']:.3f} px (95th percentile)")
    assert measured["corners"] == 700
    assert rows["median"] < 0.65 and rows["p95"] < 2.4
    assert before["median"] > 20


def test_lengths_are_millimetres(measured: dict[str, Any]) -> None:
    squares = {name: pair["square_mm"] for name, pair in measured["pairs"].items()}
    near = [squares[name] for name, pair in measured["pairs"].items() if pair["depth_mm"] < NEAR_MM]
    assert len(near) == 3
    assert max(near) / min(near) < 1.02 and np.mean(near) == pytest.approx(3.0, abs=0.05)
    assert all(2.7 < square < 3.4 for square in squares.values())


def test_transform_of_the_folder_runs_from_right_to_left(board: Path, tmp_path: Path) -> None:
    # Read as left to right, the same numbers put the right camera on the left, which is refused ...
    for path in board.glob("calib.*"):
        (tmp_path / path.name.replace("r2l", "l2r")).write_bytes(path.read_bytes())
    with pytest.raises(ValueError, match="swapped"):
        StereoCalibration.load(tmp_path, size=SIZE)
    # ... and turning only the sign of the baseline would not make rows agree.
    rig = StereoCalibration.load(board, size=SIZE)
    wrong = StereoCalibration(
        *SIZE,
        rig.left_matrix,
        rig.right_matrix,
        rig.left_distortion,
        rig.right_distortion,
        rig.rotation.T,
        rig.translation,
    )
    assert row_correlation(wrong, *read_corners(board)[1:])[0] > 10


def test_boards_are_found_and_solved_from_the_command_line(
    board: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Three of the five pairs, and at half size, keep this at a few seconds.
    import cv2

    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for number in ("1095", "1884", "4848"):
            picture = cv2.resize(read_frame(board / side / f"{side}-{number}.png"), None, fx=0.5, fy=0.5)
            cv2.imwrite(str(tmp_path / side / f"{side}-{number}.png"), picture)
    out = tmp_path / "rig.json"
    words = ["calibrate", "board", str(tmp_path / "left"), str(tmp_path / "right")]
    assert main([*words, "--pattern", "14x10", "--square-mm", "3", "--out", str(out)]) == 0
    rig = StereoCalibration.load(out, size=(960, 540))
    assert rig.baseline_mm == pytest.approx(4.7, abs=0.2)
    assert rig.left_matrix[0, 0] == pytest.approx(1010, abs=40)
    shown = capsys.readouterr()
    assert shown.err == "" and "95th percentile" in shown.out  # the bar is quiet in a pipe


def test_folder_is_converted_from_the_command_line(
    board: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rig.json"
    assert main(["calibrate", "convert", str(board), "--size", "1920x1080", "--out", str(out)]) == 0
    assert StereoCalibration.load(out) == StereoCalibration.load(board, size=SIZE)
    shown = capsys.readouterr().out
    assert "baseline    4.818 mm" in shown and "focal 2405.2 px" in shown


def test_phantom_folder_with_its_own_direction(shared_data: Path) -> None:
    folder = shared_data / "hamlyn_phantom"
    if not folder.is_dir():
        pytest.skip("no phantom pair here: name the folder that holds it in ENDOSDK_SHARED_DATA")
    rig = StereoCalibration.load(folder, size=(360, 288))
    assert rig.baseline_mm == pytest.approx(5.521, abs=1e-3)
    assert rig.translation[0] == -5.520739


def test_estimate_that_stores_height_before_width(shared_data: Path) -> None:
    path = shared_data / "scared_raw" / "calibration_estimate.json"
    if not path.is_file():
        pytest.skip("no raw pair here: name the folder that holds it in ENDOSDK_SHARED_DATA")
    with pytest.raises(ValueError, match=r"\(height, width\)"):
        StereoCalibration.load(path)
    assert StereoCalibration.load(path, size=(1280, 1024)).baseline_mm == pytest.approx(3.345, abs=1e-3)
