"""`endosdk calibrate check` and `refine`: a rig is judged and corrected by tissue alone."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from endosdk.calibration.rig import StereoCalibration
from endosdk.commands.cli import main
from endosdk.io.pictures import read_frame, write_picture
from endosdk.live.frames import Frame
from endosdk.live.rig_check import RigCheck, refine_rig
from tests.core.test_pose_error import RIG, cycles_pair, turned

ROTATION = (0.3, -0.25, 0.35)


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("footage")
    for side in ("left", "right"):
        (folder / side).mkdir()
    for number in range(4):
        left, right = cycles_pair(number)
        write_picture(folder / "left" / f"{number}.png", left)
        write_picture(folder / "right" / f"{number}.png", turned(right, ROTATION))
    RIG.save(folder / "rig.json")
    RIG.turned(ROTATION).save(folder / "right.json")
    return folder


def test_check_names_the_rotation(footage: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "check", str(footage / "rig.json"), str(footage), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["found"]
    assert found["drifted"] and found["measured"] == 4
    assert found["rotation_deg"] == pytest.approx(ROTATION, abs=0.06)
    assert main(["calibrate", "check", str(footage / "right.json"), str(footage)]) == 0
    assert "the rig fits its calibration" in capsys.readouterr().out


def test_refine_writes_a_rig_that_fits(footage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new.json"
    assert main(["calibrate", "refine", str(footage / "rig.json"), str(footage), "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "before" in shown and "after" in shown and "the rig fits its calibration" in shown
    refined, truth = StereoCalibration.load(out), RIG.turned(ROTATION)
    off = np.degrees(np.abs(refined.rotation @ truth.rotation.T - np.eye(3)).max())
    assert off < 0.05


def test_a_rig_that_fits_is_left_as_it_is(footage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new.json"
    assert main(["calibrate", "refine", str(footage / "right.json"), str(footage), "--out", str(out)]) == 0
    assert "nothing was written" in capsys.readouterr().out
    assert not out.exists()


def test_a_correction_that_makes_the_rows_worse_is_not_taken(footage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # As of a rig whose lenses are not as they were calibrated: what its frames show is no rotation.
    rig = StereoCalibration.load(footage / "rig.json")
    frames = [Frame(*(read_frame(footage / side / "0.png") for side in ("left", "right")), 0, 0)]
    away = tuple(-angle for angle in ROTATION)
    monkeypatch.setattr(RigCheck, "certain_deg", property(lambda check: away))
    refined, before, after = refine_rig(rig, frames)
    assert refined is rig
    assert after == before


def test_only_turns_that_chance_does_not_explain_move_a_rig() -> None:
    check = RigCheck(1, 1, 3.7, (-0.28, -0.64, 0.07), (0.05, 0.66, 0.08), drifted=True, causes={"RIG_MOVED": 1})
    assert check.certain_deg == (-0.28, 0.0, 0.0)
    assert not check.fits
    assert not replace(check, drifted=False).fits
    assert replace(check, drifted=False, causes={}).fits
    for cause, lenses_fit in (("NOT_RECTIFIED", True), ("SCALES_DIFFER", False), ("DISTORTED", False)):
        found = replace(check, drifted=False, causes={cause: 1})
        assert not found.fits and found.lenses_fit is lenses_fit
        assert replace(found, frames=2).fits


def test_a_wrong_focal_length_is_no_turn(footage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows that grow with their height come from the scale of one view. No turn of a camera makes them fit."""
    right = RIG.right_matrix * [[1.01], [1.01], [1.0]]
    replace(RIG.turned(ROTATION), right_matrix=right).save(tmp_path / "rig.json")
    words = [str(tmp_path / "rig.json"), str(footage)]
    assert main(["calibrate", "check", *words]) == 1
    assert "lens or scale is not what the calibration states" in capsys.readouterr().out
    assert main(["calibrate", "refine", *words, "--out", str(tmp_path / "new.json")]) == 1
    assert "no rotation makes the views fit: nothing was written" in capsys.readouterr().out
    assert not (tmp_path / "new.json").exists()


def test_one_camera_on_both_inputs_tells_nothing_of_a_rig(footage: Path, tmp_path: Path, capsys) -> None:
    for side in ("left", "right"):
        shutil.copytree(footage / "left", tmp_path / side)
    assert main(["calibrate", "check", str(footage / "rig.json"), str(tmp_path), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["found"]
    assert found["measured"] == 0 and found["causes"]["SAME_VIEW_TWICE"] == found["frames"] == 4


def test_a_source_without_tissue_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        write_picture(tmp_path / side / "0.png", np.full((720, 960, 3), 80, np.uint8))
    RIG.save(tmp_path / "rig.json")
    words = [str(tmp_path / "rig.json"), str(tmp_path)]
    assert main(["calibrate", "check", *words]) == 1
    assert "the rig could not be measured" in capsys.readouterr().out
    assert main(["calibrate", "refine", *words, "--out", str(tmp_path / "new.json")]) == 2
    assert "none measured" in capsys.readouterr().err
