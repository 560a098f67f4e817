"""Our own rig file: read back exactly, and what is said about a broken one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import (
    CalibrationSizeMismatch,
    CalibrationUnreadable,
    EndoError,
    InvalidArgument,
    InvalidCalibration,
    StorageFailed,
)
from tests.calibration.rig_files import RIG, load
from tests.rigs import fisheye_rig, raw_rig


@pytest.mark.parametrize(
    "rig",
    [
        RIG,
        fisheye_rig(),
        raw_rig(right_field_of_view=(320, 1 / 3, 300.5, 250)),
        StereoCalibration.rectified(700.1, 4.2, (640, 480), doffs=1 / 3),
    ],
    ids=["raw", "fisheye", "field of view", "rectified"],
)
def test_own_file_round_trips_exactly(tmp_path: Path, rig: StereoCalibration) -> None:
    rig.save(tmp_path / "rig.json")
    again = load(tmp_path / "rig.json", size=(rig.width, rig.height))
    assert again == rig and again.sha256 == rig.sha256
    again.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "rig.json").read_bytes()
    assert json.loads((tmp_path / "rig.json").read_text())["sha256"] == rig.sha256
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.json", "rig.json"]


@pytest.mark.parametrize("name", ["rig.yaml", "rig.yml", "rig.xml", "rig.txt", "rig"])
def test_own_file_is_known_by_its_content(tmp_path: Path, name: str) -> None:
    (written,) = RIG.save(tmp_path / (f"saved-{name}" if name.endswith((".yaml", ".yml")) else "saved.json"))
    written.rename(tmp_path / name)
    assert load(tmp_path / name) == RIG


@pytest.mark.parametrize("path", [None, 5, ["rig.json"]])
def test_save_wants_a_file_name(path: Any) -> None:
    with pytest.raises(InvalidArgument, match="path: must be a file name"):
        RIG.save(path)


FIELD_IN_SHARES = {"matrix": RIG.left_matrix.tolist(), "distortion": [], "field_of_view": [0.5, 0.5, 0.4, 0.4]}


def edited(tmp_path: Path, **changes: Any) -> Path:
    """Save the rig and replace single entries of the JSON; None removes one."""
    path = tmp_path / "rig.json"
    RIG.save(path)
    content = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps({name: value for name, value in content.items() if value is not None}))
    return path


@pytest.mark.parametrize(
    ("changes", "error", "word"),
    [
        ({"width": 641}, CalibrationUnreadable, "sha256"),
        ({"version": 2}, CalibrationUnreadable, "version"),
        ({"units": "m"}, CalibrationUnreadable, "units"),
        ({"left": None}, CalibrationUnreadable, "left"),
        ({"left": [1]}, CalibrationUnreadable, "matrix and distortion"),
        ({"left": {"matrix": 1}}, CalibrationUnreadable, "distortion"),
        ({"left": FIELD_IN_SHARES}, InvalidCalibration, "rig.json: left_field_of_view: must be middle x, y and half"),
        ({"width": "wide"}, InvalidCalibration, "rig.json: size: must be two whole numbers"),
        ({"height": 1}, InvalidCalibration, "rig.json: size: must be two whole numbers"),
        ({"rotation": "turn"}, InvalidCalibration, "rig.json: rotation"),
        ({"translation": [4.6, 0, 0]}, InvalidCalibration, "swapped"),
        ({"rotation": [[float("nan")] * 3] * 3}, InvalidCalibration, "finite"),
    ],
)
def test_own_file_names_what_is_wrong(
    tmp_path: Path, changes: dict[str, Any], error: type[EndoError], word: str
) -> None:
    with pytest.raises(error, match=word):
        load(edited(tmp_path, **changes))


def test_own_file_without_its_hash_may_be_edited(tmp_path: Path) -> None:
    assert load(edited(tmp_path, sha256=None, width=641)).width == 641


def test_own_file_refuses_another_size_and_another_unit(tmp_path: Path) -> None:
    path = edited(tmp_path)
    with pytest.raises(CalibrationSizeMismatch, match=r"rig\.json, which says \(640, 480\)"):
        load(path, size=(320, 240))
    with pytest.raises(InvalidArgument, match="units"):
        load(path, units="m")
    assert load(path, units="mm") == RIG


def test_save_reports_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StorageFailed, match="missing"):
        RIG.save(tmp_path / "missing" / "rig.json")
