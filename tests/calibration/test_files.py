"""Every layout in its true form, written here and read back; and what each reader says about a broken file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
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
from tests.rigs import fisheye_rig, raw_rig

load = StereoCalibration.load
RIG = raw_rig()
SIZE = (RIG.width, RIG.height)


def assert_same_rig(seen: StereoCalibration, expected: StereoCalibration) -> None:
    assert (seen.width, seen.height, seen.model) == (expected.width, expected.height, expected.model)
    for name in ("left_matrix", "right_matrix", "left_distortion", "right_distortion", "rotation", "translation"):
        np.testing.assert_allclose(getattr(seen, name), getattr(expected, name), rtol=1e-12, atol=1e-12, err_msg=name)


# --- our own file


@pytest.mark.parametrize(
    "rig",
    [RIG, fisheye_rig(), StereoCalibration.rectified(700.1, 4.2, (640, 480), doffs=1 / 3)],
    ids=["raw", "fisheye", "rectified"],
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
    RIG.save(tmp_path / name)
    assert load(tmp_path / name) == RIG


@pytest.mark.parametrize("path", [None, 5, ["rig.json"]])
def test_save_wants_a_file_name(path: Any) -> None:
    with pytest.raises(InvalidArgument, match="path: must be a file name"):
        RIG.save(path)


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


# --- OpenCV

SPELLINGS = {
    "K1 D1": ("K1", "D1", "K2", "D2", "R", "T"),
    "M1 D1": ("M1", "D1", "M2", "D2", "R", "T"),
    "cameraMatrix1": ("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2", "R", "T"),
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


def test_opencv_fisheye_is_the_callers_word(tmp_path: Path) -> None:
    rig = fisheye_rig()
    changes = {"D1": rig.left_distortion.reshape(4, 1), "D2": rig.right_distortion.reshape(4, 1)}
    path = write_opencv(tmp_path / "fish.yml", opencv_fields(**changes))
    assert load(path).model == "pinhole"
    assert_same_rig(load(path, layout="opencv-fisheye"), rig)


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


# --- ROS


def ros_file(path: Path, side: str, **changes: Any) -> Path:
    """Write camera_info as ROS's camera_calibration does, with the rectification of `RIG` in metres."""
    geometry = RIG.rectification()
    left = side == "left"
    projection = np.array(geometry.P1 if left else geometry.P2)
    projection[:, 3] /= 1000
    matrices = {
        "camera_matrix": RIG.left_matrix if left else RIG.right_matrix,
        "distortion_coefficients": (RIG.left_distortion if left else RIG.right_distortion).reshape(1, -1),
        "rectification_matrix": geometry.R1 if left else geometry.R2,
        "projection_matrix": projection,
    }
    lines = {"image_width": 640, "image_height": 480, "camera_name": side, "distortion_model": "plumb_bob", **changes}
    text = [f"{name}: {value}" for name, value in lines.items()]
    for name, value in matrices.items():
        rows, columns = value.shape
        text += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: {value.ravel().tolist()}"]
    path.write_text("\n".join(text) + "\n")
    return path


def test_ros_pair_gives_back_the_extrinsics(tmp_path: Path) -> None:
    rig = load((ros_file(tmp_path / "left.yaml", "left"), ros_file(tmp_path / "right.yaml", "right")))
    np.testing.assert_allclose(rig.rotation, RIG.rotation, atol=1e-12)
    np.testing.assert_allclose(rig.translation, RIG.translation, atol=1e-9)
    assert_same_rig(rig, raw_rig(rotation=rig.rotation, translation=rig.translation))


def test_ros_messages_are_read_like_files(tmp_path: Path) -> None:
    paths = []
    for side in ("left", "right"):
        text = ros_file(tmp_path / f"{side}.yaml", side).read_text()
        for long, short in (
            *(("camera_matrix", "k"), ("distortion_coefficients", "d"), ("rectification_matrix", "r")),
            *(("projection_matrix", "p"), ("image_width", "width"), ("image_height", "height")),
        ):
            text = text.replace(f"{long}:", f"{short}:")
        content = [line.strip() for line in text.splitlines() if "rows" not in line and "cols" not in line]
        flat = "\n".join(content).replace(":\ndata:", ":")
        paths.append(tmp_path / f"{side}_message.yaml")
        paths[-1].write_text(flat + "\n")
    np.testing.assert_allclose(load(paths).translation, RIG.translation, atol=1e-9)


def test_ros_left_file_alone_or_right_first_is_refused(tmp_path: Path) -> None:
    left, right = ros_file(tmp_path / "left.yaml", "left"), ros_file(tmp_path / "right.yaml", "right")
    with pytest.raises(InvalidArgument, match="needs a pair"):
        load(left)
    with pytest.raises(CalibrationUnreadable, match="left file comes first"):
        load((right, left))
    with pytest.raises(CalibrationUnreadable, match="not calibrated as a stereo pair"):
        load((left, left))


@pytest.mark.parametrize(
    ("changes", "error", "word"),
    [
        ({"image_width": 641}, CalibrationSizeMismatch, r"must be for \(640, 480\)"),
        ({"image_width": "wide"}, CalibrationUnreadable, "two numbers"),
        ({"image_height": -480}, CalibrationUnreadable, "positive"),
        ({"image_height": ".inf"}, CalibrationUnreadable, "two numbers"),
        ({"distortion_model": "equidistant"}, CalibrationUnreadable, "must be pinhole"),
        ({"distortion_model": "omni"}, CalibrationUnreadable, "must be one of plumb_bob"),
    ],
)
def test_ros_files_that_do_not_go_together(
    tmp_path: Path, changes: dict[str, Any], error: type[EndoError], word: str
) -> None:
    pair = ros_file(tmp_path / "left.yaml", "left"), ros_file(tmp_path / "right.yaml", "right", **changes)
    with pytest.raises(error, match=word):
        load(pair)


# --- Kalibr

KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 1e-05, 0.001, -0.0007]
  distortion_model: radtan
  intrinsics: [520.5, 521.75, 318.25, 241.5]
  resolution: [640, 480]
  rostopic: /left/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.0046]
  - [0.0, 1.0, 0.0, 0.00012]
  - [0.0, 0.0, 1.0, 0.00031]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.19, 0.09, -0.0005, 0.0009]
  distortion_model: radtan
  intrinsics: [519.25, 520.0, 322.125, 236.75]
  resolution: [640, 480]
  rostopic: /right/image_raw
"""


@pytest.mark.parametrize(("distortion", "model"), [("radtan", "pinhole"), ("equidistant", "fisheye")])
def test_kalibr_camchain(tmp_path: Path, distortion: str, model: str) -> None:
    (tmp_path / "camchain.yaml").write_text(KALIBR.replace("radtan", distortion))
    expected = raw_rig(
        left_distortion=np.array([-0.2, 1e-5, 0.001, -0.0007]),
        right_distortion=np.array([-0.19, 0.09, -0.0005, 0.0009]),
        rotation=np.eye(3),
        model=model,
    )
    assert_same_rig(load(tmp_path / "camchain.yaml"), expected)


@pytest.mark.parametrize(
    ("old", "new", "error", "word"),
    [
        ("camera_model: pinhole", "camera_model: omni", CalibrationUnreadable, "must be pinhole"),
        ("distortion_model: radtan", "distortion_model: fov", CalibrationUnreadable, "must be one of radtan"),
        ("cam1:", "cam2:", CalibrationUnreadable, "cam0 and cam1"),
        ("T_cn_cnm1", "T_cam_imu", CalibrationUnreadable, "T_cn_cnm1"),
        ("[519.25, 520.0, 322.125, 236.75]", "[519.25, 520.0]", CalibrationUnreadable, "intrinsics"),
        ("-0.0046]", "0.0046]", InvalidCalibration, "swapped"),
        ("-0.0046]", "-4.6]", InvalidCalibration, "units="),
        ("[-0.19, 0.09, -0.0005, 0.0009]", "[-0.19, high]", CalibrationUnreadable, "distortion_coeffs"),
    ],
)
def test_kalibr_names_what_is_wrong(tmp_path: Path, old: str, new: str, error: type[EndoError], word: str) -> None:
    assert old in KALIBR
    (tmp_path / "camchain.yaml").write_text(KALIBR.replace(old, new))
    with pytest.raises(error, match=word):
        load(tmp_path / "camchain.yaml")


def test_kalibr_cameras_must_agree(tmp_path: Path) -> None:
    head, tail = KALIBR.split("cam1:")
    for old, new, error in (
        ("radtan", "equidistant", CalibrationUnreadable),
        ("[640, 480]", "[640, 481]", CalibrationSizeMismatch),
    ):
        (tmp_path / "camchain.yaml").write_text(head + "cam1:" + tail.replace(old, new))
        with pytest.raises(error, match="cam"):
            load(tmp_path / "camchain.yaml")


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


# --- any file


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("broken.json", b'{"format": '),
        ("list.json", b"[1, 2]"),
        ("number.json", b"7"),
        ("broken.yml", OPENCV_4_YAML[:200].encode()),
        ("rows.yml", OPENCV_4_YAML.replace("rows: 3", "rows: 4").encode()),
        ("broken.xml", b"<opencv_storage><K1"),
        ("wrong.xml", b"<html></html>"),
        ("broken.yaml", b"cam0: [1, 2"),
        ("text.yaml", b"just words"),
        ("foreign.yaml", b"recipe: soup\n"),
        ("empty.yaml", b""),
        ("empty.json", b""),
        ("empty.xml", b""),
        ("picture.png", b"\x89PNG\r\n\x1a\n\x00\xff\xfe"),
        ("huge.yaml", b"a: 1\n" * 1_000_000),
    ],
)
def test_foreign_and_broken_files_are_unreadable(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CalibrationUnreadable, match=name.replace(".", r"\.")):
        load(tmp_path / name)


@pytest.mark.parametrize("layout", ["endosdk", "opencv", "ros", "kalibr", "text", "foundationstereo"])
def test_a_file_of_another_layout_is_refused_by_every_reader(tmp_path: Path, layout: str) -> None:
    (tmp_path / "other.yaml").write_text("recipe: soup\n")
    with pytest.raises((CalibrationUnreadable, InvalidArgument)):
        load(tmp_path / "other.yaml", layout=layout)


@pytest.mark.parametrize("path", ["missing.yaml", ("a", "b", "c"), (), 5, ("a", 5)])
def test_paths_that_are_none_are_refused(tmp_path: Path, path: Any) -> None:
    with pytest.raises((CalibrationUnreadable, InvalidArgument), match="path"):
        load(tmp_path / path if isinstance(path, str) else path)


def test_a_pair_of_folders_and_unknown_words_are_refused(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields())
    with pytest.raises(InvalidArgument, match="two files"):
        load((tmp_path, path))
    with pytest.raises(InvalidArgument, match="layout"):
        load(path, layout="matlab")
    with pytest.raises(InvalidArgument, match="units"):
        load(path, units="inch")
