"""The camera chain of Kalibr."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, EndoError, InvalidCalibration
from tests.calibration.rig_files import assert_same_rig, load
from tests.rigs import raw_rig

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
        ("distortion_model: radtan", "distortion_model: fov", CalibrationUnreadable, "must be one of pinhole"),
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
