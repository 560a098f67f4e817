"""Rigs that OpenCV wrote, in each of its formats and spellings; the size and the unit that a file lacks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, InvalidArgument, InvalidCalibration
from tests.calibration.rig_files import RIG, SIZE, assert_same_rig, load
from tests.rigs import fisheye_rig, raw_rig

SPELLINGS = {
    "K1 D1": ("K1", "D1", "K2", "D2", "R", "T"),
    "M1 D1": ("M1", "D1", "M2", "D2", "R", "T"),
    "cameraMatrix1": ("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"),
    "mtxL distL": ("mtxL", "distL", "mtxR", "distR", "R", "T"),
    "left_K": ("left_K", "left_D", "right_K", "right_D", "Rot", "Trns"),
    "intrinsic_left": ("intrinsic_left", "distortion_left", "intrinsic_right", "distortion_right", "R", "T"),
    "left_distortion": ("left_camera_matrix", "left_distortion", "right_camera_matrix", "right_distortion", "R", "T"),
    "camera_matrix_left": (
        *("camera_matrix_left", "dist_coeffs_left", "camera_matrix_right", "dist_coeffs_right"),
        *("rotation_matrix", "translation_vector"),
    ),
}
VALUES = (RIG.left_matrix, RIG.left_distortion, RIG.right_matrix, RIG.right_distortion, RIG.rotation, RIG.translation)


def write_opencv(path: Path, fields: dict[str, Any]) -> Path:
    """Write with OpenCV itself: vectors as rows, sizes (lists) as sequences."""
    import cv2

    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in fields.items():
        if isinstance(value, list):
            storage.startWriteStruct(name, cv2.FileNode_SEQ)
            for part in value:
                storage.write("", part)
            storage.endWriteStruct()
        else:
            storage.write(name, np.array(value) if isinstance(value, np.ndarray) else value)
    storage.release()
    return path


def opencv_fields(spelling: str = "K1 D1", **changes: Any) -> dict[str, Any]:
    return {**dict(zip(SPELLINGS[spelling], VALUES, strict=True)), "image_size": list(SIZE), **changes}


@pytest.mark.parametrize("ending", ["yml", "yaml", "xml", "json"])
@pytest.mark.parametrize("spelling", SPELLINGS)
def test_opencv_file_in_each_format_and_spelling(tmp_path: Path, ending: str, spelling: str) -> None:
    assert_same_rig(load(write_opencv(tmp_path / f"stereo.{ending}", opencv_fields(spelling))), RIG)


OPENCV_4_YAML = """%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 520.5, 0., 318.25, 0., 521.75, 241.5, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.1e-01, 1.1e-01, 1.1e-03, -7e-04, -0.03 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 519.25, 0., 322.125, 0., 520., 236.75, 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 14
   dt: d
   data: [ -0.19, 0.09, -0.0005, 0.0009, -0.02, 0., 0., 0., 0., 0., 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -4.6, 0.12, 0.31 ]
"""


def test_opencv_4_header_and_fourteen_coefficients_with_zero_tail(tmp_path: Path) -> None:
    (tmp_path / "old.yml").write_text(OPENCV_4_YAML)
    rig = load(tmp_path / "old.yml")
    right = np.append(RIG.right_distortion, [0.0, 0.0, 0.0])
    assert_same_rig(rig, raw_rig(rotation=np.eye(3), right_distortion=right))


def test_thin_prism_terms_are_refused_not_dropped(tmp_path: Path) -> None:
    (tmp_path / "old.yml").write_text(OPENCV_4_YAML.replace("0., 0. ]\nR:", "0., 0.001 ]\nR:"))
    with pytest.raises(InvalidCalibration, match=r"old\.yml: right_distortion"):
        load(tmp_path / "old.yml")


def test_opencv_sample_writes_cameras_and_extrinsics_apart(tmp_path: Path) -> None:
    fields = opencv_fields("M1 D1")
    extrinsic = {name: fields.pop(name) for name in ("R", "T")}
    inside = write_opencv(tmp_path / "intrinsics.yml", fields)
    outside = write_opencv(tmp_path / "extrinsics.yml", extrinsic)
    assert_same_rig(load((inside, outside)), RIG)
    with pytest.raises(CalibrationUnreadable, match=r"intrinsics\.yml: must hold rotation \(R\), translation \(T\)"):
        load(inside)


def test_files_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    first = write_opencv(tmp_path / "a.yml", opencv_fields())
    second = write_opencv(tmp_path / "b.yml", {"T": np.array([-5.0, 0, 0])})
    with pytest.raises(CalibrationUnreadable, match="state translation once"):
        load((first, second))


def test_one_field_under_two_spellings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationUnreadable, match="state left_matrix once"):
        load(write_opencv(tmp_path / "a.yml", opencv_fields(M1=np.eye(3))))


def test_plain_yaml_and_json_lists_under_the_same_names(tmp_path: Path) -> None:
    fields = {name: np.asarray(value).tolist() for name, value in opencv_fields().items()}
    (tmp_path / "lists.json").write_text(json.dumps(fields))
    (tmp_path / "lists.yaml").write_text("\n".join(f"{name}: {json.dumps(value)}" for name, value in fields.items()))
    assert_same_rig(load(tmp_path / "lists.json"), RIG)
    assert_same_rig(load(tmp_path / "lists.yaml"), RIG)


def fisheye_file(path: Path, **more: Any) -> Path:
    rig = fisheye_rig()
    coefficients = {"D1": rig.left_distortion.reshape(4, 1), "D2": rig.right_distortion.reshape(4, 1)}
    return write_opencv(path, opencv_fields(**coefficients, **more))


def test_opencv_fisheye_is_the_callers_word(tmp_path: Path) -> None:
    path = fisheye_file(tmp_path / "fish.yml")
    assert load(path).model == "pinhole"
    assert_same_rig(load(path, layout="opencv-fisheye"), fisheye_rig())


@pytest.mark.parametrize("ending", ["yml", "xml"])
def test_a_file_may_state_its_lens_model(tmp_path: Path, ending: str) -> None:
    path = fisheye_file(tmp_path / f"fish.{ending}", distortion_model="fisheye")
    assert_same_rig(load(path), fisheye_rig())


@pytest.mark.parametrize(
    "stated",
    [
        {"camera_model": "fisheye"},
        {"camera_model": "OPENCV_FISHEYE"},
        {"lens_model": "equidistant"},
        {"fisheye_model": 1},
        {"is_fisheye": 1},
        {"camera_model": "pinhole", "distortion_model": "equidistant"},
    ],
)
def test_a_file_may_state_its_lens_model_in_other_words(tmp_path: Path, stated: dict[str, Any]) -> None:
    assert_same_rig(load(fisheye_file(tmp_path / "fish.yml", **stated)), fisheye_rig())


@pytest.mark.parametrize(
    "stated",
    [
        {"camera_model": "FLIR BFS"},
        {"model": "ELP fisheye 170", "camera_model": "pinhole"},
        {"lens_type": "non-fisheye"},
        {"camera_model": {"type": "pinhole"}},
        {"fisheye_model": 0},
    ],
)
def test_what_names_no_fisheye_is_none(tmp_path: Path, stated: dict[str, Any]) -> None:
    fields = {name: np.asarray(value).tolist() for name, value in opencv_fields().items()}
    (tmp_path / "lists.json").write_text(json.dumps({**fields, **stated}))
    assert_same_rig(load(tmp_path / "lists.json"), RIG)


def test_a_file_must_not_contradict_itself_or_the_caller_about_its_lens(tmp_path: Path) -> None:
    path = fisheye_file(tmp_path / "fish.yml", distortion_model="plumb_bob", fisheye_model=1)
    with pytest.raises(CalibrationUnreadable, match=r"distortion_model: must not be a pinhole camera's"):
        load(path)
    path = fisheye_file(tmp_path / "fish.yml", distortion_model="plumb_bob")
    with pytest.raises(CalibrationUnreadable, match=r"distortion_model: .* for layout opencv-fisheye"):
        load(path, layout="opencv-fisheye")


@pytest.mark.parametrize(("unit", "mm"), [("cm", 10.0), ("Meters", 1000.0), ("mm", 1.0)])
def test_a_file_may_state_its_unit(tmp_path: Path, unit: str, mm: float) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(T=RIG.translation / mm, units=unit))
    np.testing.assert_allclose(load(path).translation, RIG.translation)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(units="inch"))
    with pytest.raises(
        CalibrationUnreadable, match=r"units: must be one of mm, cm, m, or be given by units=; got 'inch'"
    ):
        load(path)
    assert_same_rig(load(path, units="mm"), RIG)


def test_two_sizes_in_one_file_must_agree(tmp_path: Path) -> None:
    named = {"image_width": 640, "image_height": 480}
    assert_same_rig(load(write_opencv(tmp_path / "stereo.yml", opencv_fields(**named))), RIG)
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(**{**named, "image_size": [1920, 1080]}))
    with pytest.raises(CalibrationUnreadable, match=r"size: must be that of width and height, 640 x 480"):
        load(path)


@pytest.mark.parametrize("more", [{"size": [9, 6]}, {"size": 25.0}, {"resolution": "1080p"}])
def test_a_size_of_something_else_is_not_that_of_pictures_whose_sides_are_stated(
    tmp_path: Path, more: dict[str, Any]
) -> None:
    fields = opencv_fields(image_width=640, image_height=480, **more)
    del fields["image_size"]
    assert_same_rig(load(write_opencv(tmp_path / "stereo.yml", fields)), RIG)


def test_a_width_alone_does_not_tell_the_order_of_an_array(tmp_path: Path) -> None:
    fields = opencv_fields(image_width=640, image_size=[480, 640])
    with pytest.raises(CalibrationSizeMismatch, match=r"may mean \(width, height\) or \(height, width\)"):
        load(write_opencv(tmp_path / "stereo.yml", fields))


def test_an_unknown_lens_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationUnreadable, match=r"distortion_model: must be one of pinhole, "):
        load(fisheye_file(tmp_path / "fish.yml", distortion_model="omni"))


def test_size_is_asked_for_when_the_file_has_none(tmp_path: Path) -> None:
    fields = opencv_fields()
    del fields["image_size"]
    path = write_opencv(tmp_path / "stereo.yml", fields)
    with pytest.raises(CalibrationSizeMismatch, match=r"stereo\.yml holds no picture size"):
        load(path)
    assert_same_rig(load(path, size=SIZE), RIG)


def test_size_must_agree_with_the_file(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields())
    with pytest.raises(CalibrationSizeMismatch, match=r"which says \(640, 480\)"):
        load(path, size=(1280, 960))


def test_a_size_of_other_frames_is_warned_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    fields = opencv_fields()
    del fields["image_size"]
    path = write_opencv(tmp_path / "stereo.yml", fields)
    load(path, size=SIZE)
    assert caplog.text == ""
    load(path, size=(1280, 960))
    assert "stereo.yml: both principal points lie far from the middle of a picture of 1280x960" in caplog.text


def test_centimetres_are_warned_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_opencv(tmp_path / "cm.yml", opencv_fields(T=RIG.translation.reshape(3, 1) / 5))
    assert load(path).baseline_mm == pytest.approx(RIG.baseline_mm / 5)
    assert "cm.yml: the baseline is" in caplog.text and "lengths were read in mm" in caplog.text
    caplog.clear()
    assert load(path, units="cm").baseline_mm == pytest.approx(2 * RIG.baseline_mm)
    assert caplog.text == ""


def test_size_stored_as_height_and_width_needs_the_callers_word(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(image_size=np.array([480.0, 640.0])))
    with pytest.raises(CalibrationSizeMismatch, match=r"\(width, height\) or \(height, width\)"):
        load(path)
    assert_same_rig(load(path, size=SIZE), RIG)


def test_size_that_leaves_the_principal_point_outside_is_refused(tmp_path: Path) -> None:
    fields = opencv_fields()
    del fields["image_size"]
    path = write_opencv(tmp_path / "stereo.yml", fields)
    with pytest.raises(CalibrationSizeMismatch, match=r"principal point is \(318\.2, 241\.5\)"):
        load(path, size=(320, 240))


@pytest.mark.parametrize("size", [(640, 0), (640, 480.0), 640, (640, 480, 3)])
def test_size_that_is_no_size_is_refused(tmp_path: Path, size: Any) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields())
    with pytest.raises(InvalidArgument, match="size"):
        load(path, size=size)


@pytest.mark.parametrize(("factor", "units"), [(0.001, "m"), (0.1, "cm"), (1.0, "mm")])
def test_units_are_converted_to_millimetres(tmp_path: Path, factor: float, units: str) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(T=RIG.translation * factor))
    assert_same_rig(load(path, units=units), RIG)


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_implausible_baseline_names_the_remedy(tmp_path: Path, factor: float) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(T=RIG.translation * factor))
    with pytest.raises(InvalidCalibration, match="units="):
        load(path)


def test_swapped_cameras_are_refused_with_the_file_named(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields(T=-RIG.translation))
    with pytest.raises(InvalidCalibration, match=r"stereo\.yml: translation: .*swapped"):
        load(path)
