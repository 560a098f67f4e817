"""The calibration object: what it accepts, how it scales and crops, and the geometry it leads to."""

from __future__ import annotations

import copy
import dataclasses
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument, InvalidCalibration
from endosdk.measure import rectified_to_raw
from tests.conftest import ROOT
from tests.rigs import fisheye_rig, raw_rig, rig_fields, rotation


def camera(fx: float = 500.0, fy: float = 500.0, skew: float = 0.0, last: float = 1.0) -> np.ndarray:
    return np.array([[fx, skew, 320], [0, fy, 240], [0, 0, last]])


BAD_FIELDS: list[tuple[str, Any, str]] = [
    ("left_matrix", camera(fx=0.0), "positive focal"),
    ("right_matrix", camera(fy=-500.0), "positive focal"),
    ("left_matrix", camera(skew=0.2), "skew"),
    ("left_matrix", camera(last=2.0), "skew"),
    ("left_matrix", np.eye(4), "shape"),
    ("right_matrix", camera(fx=np.nan), "finite"),
    ("left_matrix", "focal", "array of numbers"),
    ("left_distortion", [0.1, np.inf, 0, 0], "finite"),
    ("left_distortion", [0.1, 0.2, 0.3], "0, 4, 5 or 8"),
    ("right_distortion", np.zeros((1, 5)), "flat list"),
    ("rotation", np.zeros((3, 3)), "orthonormal"),
    ("rotation", np.eye(3) * 1.001, "orthonormal"),
    ("rotation", np.diag([1.0, 1.0, -1.0]), "mirrors"),
    ("rotation", np.full((3, 3), np.nan), "finite"),
    ("translation", [0.0, 0.0, 0.0], "baseline must be positive"),
    ("translation", [4.6, 0.1, 0.3], "swapped"),
    ("translation", [0.2, -4.6, 0.1], "vertical"),
    ("translation", [-0.2, 0.1, 4.6], "in front"),
    ("translation", [-4.6, np.nan, 0.0], "finite"),
    ("translation", [-4.6, 0.0], "shape"),
    ("model", "omni", "pinhole, fisheye"),
    ("left_field_of_view", (320.0, 240.0, 200.0), "shape"),
    ("left_field_of_view", (320.0, 240.0, np.nan, 200.0), "finite"),
    ("right_field_of_view", (0.5, 0.4, 0.4, 0.4), "at least a twentieth"),
    ("right_field_of_view", (320.0, 240.0, -200.0, 200.0), "at least a twentieth"),
    ("left_field_of_view", (320.0, -240.0, 200.0, 200.0), "reach into the frame, 640x480"),
]


@pytest.mark.parametrize(("name", "value", "rule"), BAD_FIELDS)
def test_impossible_numbers_are_refused_by_name(name: str, value: Any, rule: str) -> None:
    with pytest.raises(InvalidCalibration, match=rule) as caught:
        StereoCalibration(**rig_fields(**{name: value}))
    assert caught.value.argument == name
    assert caught.value.code.name == "INVALID_CALIBRATION"


@pytest.mark.parametrize(
    "change", [{"width": 0}, {"height": -480}, {"width": 640.5}, {"height": True}, {"width": "640"}, {"width": 2**33}]
)
def test_impossible_sizes_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidArgument, match="whole numbers"):
        StereoCalibration(**rig_fields(**change))


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_a_rig_in_another_unit_is_refused(factor: float) -> None:
    with pytest.raises(InvalidCalibration, match=r"baseline: must be 0\.5 to 1000 mm"):
        StereoCalibration(**rig_fields(translation=np.array([-4.6, 0.1, 0.3]) * factor))
    with pytest.raises(InvalidCalibration, match=r"baseline: must be 0\.5 to 1000 mm"):
        StereoCalibration.rectified(focal_px=400, baseline_mm=5 * factor, size=(960, 720))


def test_fisheye_takes_four_coefficients_only() -> None:
    with pytest.raises(InvalidCalibration, match="0 or 4 coefficients for a fisheye"):
        raw_rig(model="fisheye")
    assert fisheye_rig().model == "fisheye"


def test_rotation_printed_with_five_decimals_is_accepted() -> None:
    rounded = np.round(rotation(0.011, -0.023, 0.007), 5)
    assert np.array_equal(raw_rig(rotation=rounded).rotation, rounded)


def test_object_is_immutable_and_keeps_no_hold_on_its_input() -> None:
    fields = rig_fields()
    rig = StereoCalibration(**fields)
    fields["translation"][0] = 99.0
    assert rig.translation[0] == -4.6
    with pytest.raises(ValueError, match="read-only"):
        rig.rotation[0, 0] = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        rig.width = 1  # type: ignore[misc]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda rig: pickle.loads(pickle.dumps(rig))])
def test_copies_are_equal_and_immutable_too(duplicate: Callable[[StereoCalibration], StereoCalibration]) -> None:
    rig = fisheye_rig()
    twin = duplicate(rig)
    assert twin == rig and twin.sha256 == rig.sha256
    with pytest.raises(ValueError, match="read-only"):
        twin.translation[0] = 1.0


def test_equality_and_hash_follow_the_content() -> None:
    rig, twin, other = raw_rig(), raw_rig(), raw_rig(translation=np.array([-4.6, 0.12, np.nextafter(0.31, 1)]))
    assert rig == twin and hash(rig) == hash(twin) and rig.sha256 == twin.sha256
    assert rig != other and rig.sha256 != other.sha256
    assert rig != "rig"
    assert len({rig, twin, other}) == 2


def test_minus_nought_is_nought() -> None:
    zeros = {"left_distortion": np.zeros(4), "translation": np.array([-4.6, 0.0, 0.0])}
    rig, twin = raw_rig(**zeros), raw_rig(left_distortion=-zeros["left_distortion"], translation=[-4.6, -0.0, -0.0])
    assert rig == twin and hash(rig) == hash(twin) and rig.sha256 == twin.sha256


def test_sha256_is_the_same_in_another_process() -> None:
    code = "from tests.rigs import raw_rig; print(raw_rig().sha256)"
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == raw_rig().sha256


@pytest.mark.parametrize(
    "change", ["width", "left_matrix", "right_distortion", "rotation", "translation", "model", "left_field_of_view"]
)
def test_sha256_depends_on_every_field(change: str) -> None:
    new: dict[str, Any] = {
        "width": 641,
        "left_matrix": camera(),
        "right_distortion": np.zeros(5),
        "rotation": np.eye(3),
        "translation": np.array([-4.7, 0.12, 0.31]),
        "model": "fisheye",
        "left_field_of_view": (320, 240, 250, 250),
    }
    base = raw_rig(left_distortion=np.zeros(4), right_distortion=np.full(4, 0.01))
    changed = raw_rig(**{"left_distortion": np.zeros(4), "right_distortion": np.full(4, 0.01), change: new[change]})
    assert base.sha256 != changed.sha256


# --- rectified rigs


def test_rectified_defaults_to_the_middle_of_the_picture() -> None:
    rig = StereoCalibration.rectified(700.0, 4.2, (641, 481))
    assert rig.is_rectified and rig.baseline_mm == 4.2
    assert rig.left_matrix[0, 2] == 320.0 and rig.left_matrix[1, 2] == 240.0


def test_rectification_of_a_rectified_rig_changes_nothing() -> None:
    rig = StereoCalibration.rectified(700.0, 4.2, (640, 480), cx=300.5, cy=222.25, doffs=17.5)
    geometry = rig.rectification()
    assert np.array_equal(geometry.R1, np.eye(3)) and np.array_equal(geometry.R2, np.eye(3))
    assert np.array_equal(geometry.P1[:, :3], rig.left_matrix) and np.array_equal(geometry.P2[:, :3], rig.right_matrix)
    assert (geometry.cx, geometry.cy, geometry.doffs) == (300.5, 222.25, 17.5)
    assert (geometry.focal_px, geometry.baseline_mm) == (700.0, pytest.approx(4.2, rel=1e-15))


@pytest.mark.parametrize(
    "change",
    [
        {"left_distortion": np.array([1e-3, 0, 0, 0])},
        {"rotation": rotation(0, 1e-4, 0)},
        {"translation": np.array([-4.2, 0.001, 0])},
        {"right_matrix": np.array([[500, 0, 320], [0, 500, 241.0], [0, 0, 1]])},
        {"right_matrix": np.array([[501, 0, 320], [0, 500, 240.0], [0, 0, 1]])},
    ],
)
def test_anything_that_moves_rows_makes_the_rig_raw(change: dict[str, Any]) -> None:
    straight = {
        "left_matrix": camera(),
        "right_matrix": camera(),
        "left_distortion": np.zeros(5),
        "right_distortion": np.zeros(0),
        "rotation": np.eye(3),
        "translation": np.array([-4.2, 0, 0]),
    }
    assert raw_rig(**straight).is_rectified
    assert not raw_rig(**{**straight, **change}).is_rectified


@pytest.mark.parametrize(
    ("options", "argument"),
    [
        ({"baseline_mm": -4.2}, "baseline_mm"),
        ({"baseline_mm": 0}, "baseline_mm"),
        ({"focal_px": float("nan")}, "focal_px"),
        ({"focal_px": -1.0}, "left_matrix"),
        ({"size": (640,)}, "size"),
        ({"doffs": "3"}, "doffs"),
        ({"cx": float("inf")}, "cx"),
    ],
)
def test_rectified_names_the_wrong_argument(options: dict[str, Any], argument: str) -> None:
    with pytest.raises((InvalidArgument, InvalidCalibration)) as caught:
        StereoCalibration.rectified(**{"focal_px": 700.0, "baseline_mm": 4.2, "size": (640, 480), **options})
    assert caught.value.argument == argument


# --- geometry


def project(rig: StereoCalibration, geometry: RectifiedGeometry, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rectified pixels of a point [3] given in the left camera, through the rotations and projections."""
    views = []
    for turn, view, place in ((geometry.R1, geometry.P1, point), (geometry.R2, geometry.P2, None)):
        seen = turn @ (place if place is not None else rig.rotation @ point + rig.translation)
        # P2's fourth column expects points of the left rectified frame; the right camera's own need K only.
        pixel = view[:, :3] @ seen
        views.append(pixel[:2] / pixel[2])
    return views[0], views[1]


@pytest.mark.parametrize("rig", [raw_rig(), fisheye_rig()], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("alpha", [0.0, 0.6, 1.0])
def test_rectified_points_share_a_row_and_give_their_depth(rig: StereoCalibration, alpha: float) -> None:
    geometry = rig.rectification(alpha=alpha)
    for point in ([0.0, 0.0, 60.0], [12.0, -9.0, 80.0], [-20.0, 15.0, 140.0]):
        left, right = project(rig, geometry, np.array(point))
        assert left[1] == pytest.approx(right[1], abs=1e-6)
        depth = geometry.focal_px * geometry.baseline_mm / (left[0] - right[0] + geometry.doffs)
        assert depth == pytest.approx((geometry.R1 @ point)[2], rel=1e-9)
    assert geometry.baseline_mm == pytest.approx(rig.baseline_mm)


@pytest.mark.parametrize("alpha", [-1.0, 0.0, 1.0])
def test_rectification_equals_opencv(alpha: float) -> None:
    import cv2

    rig = raw_rig()
    expected = cv2.stereoRectify(
        rig.left_matrix.copy(),
        rig.left_distortion.reshape(1, -1).copy(),
        rig.right_matrix.copy(),
        rig.right_distortion.reshape(1, -1).copy(),
        (rig.width, rig.height),
        rig.rotation.copy(),
        rig.translation.reshape(3, 1).copy(),
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=alpha,
    )[:4]
    geometry = rig.rectification(alpha=alpha)
    for ours, theirs in zip((geometry.R1, geometry.R2, geometry.P1, geometry.P2), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    "window", [(0, 0, 640, 240), (0, 240, 640, 240), (0, 0, 320, 480), (320, 0, 320, 480), (0, 0, 200, 150)]
)
def test_a_cropped_rig_shows_about_what_the_window_shows(window: tuple[int, int, int, int]) -> None:
    """OpenCV enlarges about the principal point: many times, where that lies near an edge of the picture."""
    rig = raw_rig().cropped(*window)
    geometry = rig.rectification()
    assert 0.8 < geometry.focal_px / raw_rig().rectification().focal_px < 1.5
    corners = [(x, y) for x in (0, window[2] - 1) for y in (0, window[3] - 1)]
    for right in (False, True):
        raw = rectified_to_raw(rig, corners, side="right" if right else "left")
        assert (np.abs(raw - np.clip(raw, 0, [window[2] - 1, window[3] - 1])) < 1).all()


@pytest.mark.parametrize("rig", [raw_rig(), fisheye_rig()], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("size", [(320, 480), (640, 240)])
def test_half_width_video_shows_what_the_whole_one_does(rig: StereoCalibration, size: tuple[int, int]) -> None:
    """OpenCV's square pixels would show half of it: in a frame of half the width, at the full height's focal length."""
    whole, half = rig.rectification(), rig.scaled(*size).rectification()
    expected = whole.scaled(*size)
    for name in ("P1", "P2", "R1", "R2"):
        np.testing.assert_allclose(getattr(half, name), getattr(expected, name), rtol=1e-2, atol=1e-3, err_msg=name)
    assert half.baseline_mm == pytest.approx(whole.baseline_mm)


def test_nearly_square_pixels_become_square_as_in_opencv() -> None:
    matrix = raw_rig().left_matrix.copy()
    matrix[0, 0] *= 1.03
    geometry = raw_rig(left_matrix=matrix, right_matrix=matrix).rectification()
    assert geometry.focal_px == geometry.focal_y_px


def test_a_rotation_may_be_rounded_to_four_decimals() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        turn = rotation(*np.radians(rng.normal(0, 6, 3)))
        raw_rig(rotation=turn.round(4))


def test_cameras_one_above_the_other_are_no_rig() -> None:
    with pytest.raises(InvalidCalibration, match="must lie side by side"):
        raw_rig(rotation=rotation(0, 0, 1.2), translation=np.array([-5.0, 3.0, 0.0])).rectification()


@pytest.mark.parametrize("alpha", [1.5, -0.5, 10**400, float("nan"), "0", None])
def test_alpha_outside_its_range_is_refused(alpha: Any) -> None:
    with pytest.raises(InvalidArgument, match="alpha"):
        raw_rig().rectification(alpha=alpha)


def test_rectified_size_is_the_same_view_resampled() -> None:
    rig = raw_rig()
    full, half = rig.rectification(), rig.rectification(size=(320, 240))
    assert (half.width, half.height) == (320, 240)
    assert half.focal_px == pytest.approx(full.focal_px / 2)
    assert half.baseline_mm == pytest.approx(full.baseline_mm)
    assert half.cx + 0.5 == pytest.approx((full.cx + 0.5) / 2)


@pytest.mark.parametrize("name", ["P1", "R2"])
def test_geometry_without_finite_numbers_is_refused(name: str) -> None:
    geometry = raw_rig().rectification()
    broken = np.array(getattr(geometry, name))
    broken[0, 0] = np.nan
    with pytest.raises(InvalidCalibration, match=name):
        dataclasses.replace(geometry, **{name: broken})


# --- scaling and cropping: the depth of a scene point must not change


@pytest.mark.parametrize("doffs", [0.0, 23.5])
def test_depth_survives_scaling_and_cropping(doffs: float) -> None:
    rig = StereoCalibration.rectified(700.0, 4.2, (640, 480), cx=300.5, doffs=doffs)
    disparity = 41.0
    depth = 700.0 * 4.2 / (disparity + doffs)
    for changed, seen in (
        (rig.scaled(960, 720), disparity * 1.5),
        (rig.scaled(213, 480), disparity * 213 / 640),
        (rig.cropped(100, 20, 400, 300), disparity),
        (rig.cropped(100, 20, 400, 300).scaled(200, 150), disparity / 2),
    ):
        geometry = changed.rectification()
        assert geometry.focal_px * geometry.baseline_mm / (seen + geometry.doffs) == pytest.approx(depth)


@pytest.mark.parametrize("of_geometry", [False, True], ids=["calibration", "geometry"])
def test_scaling_moves_pixel_centres(of_geometry: bool) -> None:
    rig = StereoCalibration.rectified(700.0, 4.2, (640, 480), cx=300.5, cy=200.0, doffs=12.0)
    scaled: Any = rig.rectification().scaled(160, 120) if of_geometry else rig.scaled(160, 120).rectification()
    # Pixel 0 covers 0..4 of the large picture, so its centre is at 1.5 there: c' = (c + 0.5) / 4 - 0.5.
    assert (scaled.cx, scaled.cy) == (74.75, 49.625)
    assert scaled.doffs == pytest.approx(3.0) and scaled.focal_px == pytest.approx(175.0)
    assert scaled.baseline_mm == pytest.approx(4.2)
    assert (scaled.width, scaled.height) == (160, 120)


@pytest.mark.parametrize("of_geometry", [False, True], ids=["calibration", "geometry"])
def test_cropping_shifts_the_centre_only(of_geometry: bool) -> None:
    rig = StereoCalibration.rectified(700.0, 4.2, (640, 480), cx=300.5, cy=200.0, doffs=12.0)
    window = (40, 30, 500, 400)
    cropped: Any = rig.rectification().cropped(*window) if of_geometry else rig.cropped(*window).rectification()
    assert (cropped.cx, cropped.cy, cropped.doffs, cropped.focal_px) == (260.5, 170.0, 12.0, 700.0)
    assert (cropped.width, cropped.height) == (500, 400)


def test_the_field_of_view_is_scaled_and_cropped_with_the_picture() -> None:
    rig = raw_rig(left_field_of_view=(319.5, 240, 250, 240))
    assert rig.scaled(320, 960).left_field_of_view == (159.5, 480.5, 125, 480)
    assert rig.cropped(40, 30, 500, 400).left_field_of_view == (279.5, 210, 250, 240)
    assert rig.turned((0.1, 0, 0)).left_field_of_view == rig.left_field_of_view
    assert rig.cropped(40, 30, 500, 400).right_field_of_view is None
    assert raw_rig(left_field_of_view=(0, 0, 0, 0)) == raw_rig()


def test_scaling_a_raw_rig_scales_its_projection() -> None:
    rig = raw_rig()
    point, scale = np.array([3.0, -2.0, 50.0]), np.array([1280 / 640, 960 / 480])
    pixel = (rig.left_matrix @ point)[:2] / point[2]
    scaled = (rig.scaled(1280, 960).left_matrix @ point)[:2] / point[2]
    np.testing.assert_allclose(scaled, (pixel + 0.5) * scale - 0.5)
    np.testing.assert_array_equal(rig.scaled(1280, 960).left_distortion, rig.left_distortion)


def test_scaling_back_and_forth_returns() -> None:
    rig = raw_rig()
    back = rig.scaled(1920, 1440).scaled(640, 480)
    np.testing.assert_allclose(back.left_matrix, rig.left_matrix, rtol=1e-14)


@pytest.mark.parametrize(
    "window", [(-1, 0, 10, 10), (0, 0, 641, 480), (600, 0, 41, 10), (0, 0, 0, 10), (0.5, 0, 10, 10), (0, 471, 5, 10)]
)
def test_windows_outside_the_picture_are_refused(window: Any) -> None:
    rig = raw_rig()
    with pytest.raises(InvalidArgument, match="inside the 640x480 picture"):
        rig.cropped(*window)
    with pytest.raises(InvalidArgument, match="inside the 640x480 picture"):
        rig.rectification().cropped(*window)


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (1, 480)])
def test_a_picture_too_small_to_rectify_is_a_typed_error(size):
    with pytest.raises(InvalidArgument, match="2 to 32767"):
        raw_rig().scaled(*size)
