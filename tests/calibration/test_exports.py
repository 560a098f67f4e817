"""A rig written for other programs, by the file's name, reads back as the same rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from endosdk.calibration.rig import StereoCalibration
from endosdk.calibration.rules import CameraModel
from endosdk.commands.cli import main
from endosdk.errors import InvalidArgument
from endosdk.live.recording.bags import type_store
from endosdk.live.recording.messages import LEFT, MessageMaker
from tests.rigs import fisheye_rig, raw_rig

BROWN = {
    "left_distortion": np.array([-0.2, 0.1, 0.001, -0.0007]),
    "right_distortion": np.array([-0.1, 0.1, 0.0, 0.001]),
}


def assert_same(seen: StereoCalibration, rig: StereoCalibration) -> None:
    assert (seen.width, seen.height, seen.model) == (rig.width, rig.height, rig.model)
    for name in ("left_matrix", "right_matrix", "rotation", "translation"):
        np.testing.assert_allclose(getattr(seen, name), getattr(rig, name), atol=1e-6)
    for name in ("left_distortion", "right_distortion"):
        found, wanted = getattr(seen, name), getattr(rig, name)
        np.testing.assert_allclose(found[: wanted.size], wanted, atol=1e-9)
        assert not found[wanted.size :].any()


@pytest.mark.parametrize("ending", ["opencv", "kalibr", "ros"])
@pytest.mark.parametrize("rig", [raw_rig(**BROWN), fisheye_rig()], ids=["pinhole", "fisheye"])
def test_what_is_written_reads_back(tmp_path: Path, ending: str, rig: StereoCalibration) -> None:
    written = rig.save(tmp_path / f"rig.{ending}.yaml")
    assert all(path.is_file() for path in written)
    read = StereoCalibration.load(written[0] if len(written) == 1 else tuple(written))
    assert_same(read, rig)


@pytest.mark.parametrize("ending", ["opencv", "kalibr", "ros"])
def test_a_rectified_rig_whose_pixels_are_not_square_is_written(tmp_path: Path, ending: str) -> None:
    square = StereoCalibration.rectified(focal_px=500, baseline_mm=4, size=(640, 480))
    matrix = square.left_matrix * [[1.0], [0.9], [1.0]]
    rig = replace(square, left_matrix=matrix, right_matrix=matrix)
    written = rig.save(tmp_path / f"rig.{ending}.yaml")
    assert_same(StereoCalibration.load(written[0] if len(written) == 1 else tuple(written)), rig)


def test_ros_has_two_files_and_metres(tmp_path: Path) -> None:
    rig = raw_rig()
    left, right = rig.save(tmp_path / "rig.ros.yaml")
    assert (left.name, right.name) == ("rig.left.ros.yaml", "rig.right.ros.yaml")
    geometry = rig.rectification()
    assert str(geometry.P2[0, 3] * 1e-3) in right.read_text()


@pytest.mark.parametrize(
    ("model", "count", "name", "wanted"),
    [
        ("fisheye", 0, "equidistant", 4),
        ("fisheye", 4, "equidistant", 4),
        ("pinhole", 0, "plumb_bob", 5),
        ("pinhole", 4, "plumb_bob", 5),
        ("pinhole", 5, "plumb_bob", 5),
        ("pinhole", 8, "rational_polynomial", 8),
    ],
)
def test_files_and_messages_of_ros_hold_as_many_coefficients_as_their_model_takes(
    tmp_path: Path, model: CameraModel, count: int, name: str, wanted: int
) -> None:
    distortion = np.linspace(0.01, 0.02, count)
    rig = raw_rig(model=model, left_distortion=distortion, right_distortion=distortion)
    left, _ = rig.save(tmp_path / "rig.ros.yaml")
    stated = yaml.safe_load(left.read_text())
    make = MessageMaker(type_store(ros1=False).types, ros1=False)
    message = make.camera(0, LEFT, rig, rig.rectification())
    assert (stated["distortion_model"], message.distortion_model) == (name, name)
    padded = [*distortion, *[0.0] * (wanted - count)]
    assert stated["distortion_coefficients"]["data"] == pytest.approx(padded)
    assert message.d.tolist() == pytest.approx(padded)


def test_opencv_itself_reads_the_file(tmp_path: Path) -> None:
    rig = raw_rig()
    (path,) = rig.save(tmp_path / "rig.opencv.yaml")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_allclose(storage.getNode("K1").mat(), rig.left_matrix)
    np.testing.assert_allclose(storage.getNode("T").mat().ravel(), rig.translation)
    g = rig.rectification()
    point = storage.getNode("Q").mat() @ (g.cx + 50, g.cy, 20.0, 1.0)
    assert point[2] / point[3] == pytest.approx(g.focal_px * g.baseline_mm / (20.0 + g.doffs))


@pytest.mark.parametrize("name", ["rig", "rig.txt", "rig.opencv.xml"])
def test_an_ending_that_stands_for_no_layout_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidArgument, match=r"^path: must end in one of \.json, \.yaml, \.yml, \.opencv\.yaml"):
        raw_rig().save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_coefficients_that_kalibr_cannot_hold_are_refused(tmp_path: Path) -> None:
    rig = raw_rig(left_distortion=np.array([-0.2, 0.1, 0, 0, 0.03]))
    with pytest.raises(InvalidArgument, match="four coefficients"):
        rig.save(tmp_path / "rig.kalibr.yaml")


@pytest.mark.parametrize("ending", ["opencv", "kalibr", "ros"])
def test_a_field_of_view_that_is_left_out_is_named(
    tmp_path: Path, ending: str, caplog: pytest.LogCaptureFixture
) -> None:
    raw_rig(**BROWN).save(tmp_path / "none.json")
    raw_rig(**BROWN, left_field_of_view=(320.0, 240.0, 300.0, 200.0)).save(tmp_path / "stated.json")
    out = tmp_path / f"rig.{ending}.yaml"
    assert main(["calibrate", "convert", str(tmp_path / "none.json"), "--out", str(out)]) == 0
    assert caplog.messages == []
    assert main(["calibrate", "convert", str(tmp_path / "stated.json"), "--out", str(out)]) == 0
    kept = "it is left out; .json and .yaml keep it"
    assert caplog.messages == [f"{out}: this format cannot hold field_of_view (left): {kept}"]
    assert main(["calibrate", "convert", str(tmp_path / "stated.json"), "--out", str(tmp_path / "own.yaml")]) == 0
    assert len(caplog.messages) == 1
