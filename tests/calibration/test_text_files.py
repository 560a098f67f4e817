"""Folders of text files, and the text file of FoundationStereo."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import CalibrationUnreadable
from tests.calibration.rig_files import RIG, SIZE, assert_same_rig, load

# --- text folder


def text_folder(folder: Path, direction: str = "l2r", ending: str = "txt") -> Path:
    folder.mkdir(exist_ok=True)
    for side, matrix, distortion in (
        ("left", RIG.left_matrix, RIG.left_distortion),
        ("right", RIG.right_matrix, RIG.right_distortion),
    ):
        np.savetxt(folder / f"calib.{side}.intrinsic.txt", matrix, fmt="%.17g")
        np.savetxt(folder / f"calib.{side}.distortion.txt", distortion[None], fmt="%.17g")
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = RIG.rotation, RIG.translation
    transform = transform if direction == "l2r" else np.linalg.inv(transform)
    np.savetxt(folder / f"calib.{direction}.{ending}", transform, fmt="%.17g")
    return folder


@pytest.mark.parametrize("direction", ["l2r", "r2l"])
@pytest.mark.parametrize("ending", ["txt", "4x4"])
def test_text_folder_in_both_directions(tmp_path: Path, direction: str, ending: str) -> None:
    assert_same_rig(load(text_folder(tmp_path / "rig", direction, ending), size=SIZE), RIG)


def _break(name: str, text: str | None) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        if text is None:
            (folder / name).unlink()
        else:
            (folder / name).write_text(text)

    return change


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (_break("calib.left.intrinsic.txt", None), "must hold calib.left.intrinsic.txt"),
        (_break("calib.l2r.txt", None), "must hold one of"),
        (_break("calib.r2l.txt", "1"), "must hold one of"),
        (_break("calib.l2r.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 2\n"), "0 0 0 1"),
        (_break("calib.left.intrinsic.txt", "520 0 318\n0 521"), "shape"),
        (_break("calib.right.distortion.txt", "none"), "numbers only"),
    ],
)
def test_text_folder_names_what_is_wrong(tmp_path: Path, change: Callable[[Path], None], word: str) -> None:
    folder = text_folder(tmp_path / "rig")
    change(folder)
    with pytest.raises(CalibrationUnreadable, match=word):
        load(folder, size=SIZE)


# --- FoundationStereo


def test_foundationstereo_text_is_a_rectified_rig_in_metres(tmp_path: Path) -> None:
    (tmp_path / "K.txt").write_text("700.5 0.0 319.5 0.0 700.5 239.5 0.0 0.0 1.0\n0.0042\n")
    rig = load(tmp_path / "K.txt", size=SIZE)
    assert rig.is_rectified and rig.baseline_mm == pytest.approx(4.2)
    assert rig == StereoCalibration.rectified(700.5, rig.baseline_mm, SIZE, 319.5, 239.5)


@pytest.mark.parametrize("text", ["700 0 319\n0.0042\n", "1 2 3 4 5 6 7 8 9\n", ""])
def test_foundationstereo_with_other_rows_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "K.txt").write_text(text)
    with pytest.raises(CalibrationUnreadable, match="row of nine numbers"):
        load(tmp_path / "K.txt", size=SIZE, layout="foundationstereo")
