"""A pair of ROS camera files, and ROS messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from endosdk.errors import CalibrationSizeMismatch, CalibrationUnreadable, EndoError, InvalidArgument
from tests.calibration.rig_files import RIG, assert_same_rig, load
from tests.rigs import raw_rig


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
        paths[-1].write_text(flat + "\n---\n")  # as `ros2 topic echo` ends a message
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
        ({"distortion_model": "omni"}, CalibrationUnreadable, "must be one of pinhole"),
    ],
)
def test_ros_files_that_do_not_go_together(
    tmp_path: Path, changes: dict[str, Any], error: type[EndoError], word: str
) -> None:
    pair = ros_file(tmp_path / "left.yaml", "left"), ros_file(tmp_path / "right.yaml", "right", **changes)
    with pytest.raises(error, match=word):
        load(pair)
