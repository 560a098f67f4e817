"""Rectified geometry against OpenCV and against the numpy twin."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk import _core
from tests.core_rigs import Rig, random_rig, rotation
from tests.reference import resampling

SIZE = (960, 720)
LENSES = [("pinhole", 0), ("pinhole", 4), ("pinhole", 5), ("pinhole", 8), ("fisheye", 4)]


def opencv_rectify(rig: Rig, alpha: float) -> tuple[np.ndarray, ...]:
    column = rig.T.reshape(3, 1)
    flags = cv2.CALIB_ZERO_DISPARITY
    if rig.model == "fisheye":
        return cv2.fisheye.stereoRectify(
            rig.K1, rig.D1, rig.K2, rig.D2, rig.size, rig.R, column, flags=flags, balance=alpha
        )[:4]
    first, second = (d if d.size else np.zeros(4) for d in (rig.D1, rig.D2))
    return cv2.stereoRectify(rig.K1, first, rig.K2, second, rig.size, rig.R, column, flags=flags, alpha=alpha)[:4]


# OpenCV's fisheye rectification knows no negative alpha.
SCALED = [(*lens, alpha) for lens in LENSES for alpha in (-1.0, 0.0, 0.4, 1.0) if lens[0] == "pinhole" or alpha >= 0]


@pytest.mark.parametrize(("model", "coefficients", "alpha"), SCALED)
def test_rectification_equals_opencv(model: str, coefficients: int, alpha: float) -> None:
    for seed in range(25):
        rig = random_rig(seed, coefficients, model, SIZE)
        R1, R2, P1, P2 = rig.rectified(alpha)
        expected = opencv_rectify(rig, alpha)
        np.testing.assert_allclose(R1, expected[0], rtol=0, atol=1e-8)
        np.testing.assert_allclose(R2, expected[1], rtol=0, atol=1e-8)
        np.testing.assert_allclose(P1, expected[2], rtol=1e-6, atol=0)
        np.testing.assert_allclose(P2, expected[3], rtol=1e-6, atol=0)


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
def test_maps_equal_opencv_and_twin(model: str, coefficients: int) -> None:
    rig = random_rig(3, coefficients, model, SIZE)
    R1, _, P1, _ = rig.rectified()
    map_x, map_y = _core.undistort_map(model, rig.K1, rig.D1, R1, P1, *SIZE)
    if model == "fisheye":
        expected = cv2.fisheye.initUndistortRectifyMap(rig.K1, rig.D1, R1, P1, SIZE, cv2.CV_32FC1)
    else:
        lens = rig.D1 if rig.D1.size else np.zeros(4)
        expected = cv2.initUndistortRectifyMap(rig.K1, lens, R1, P1, SIZE, cv2.CV_32FC1)
    twin = resampling.source_map(model, rig.K1, rig.D1, R1, P1, SIZE)
    for axis, ours in enumerate((map_x, map_y)):
        assert ours.dtype == np.float32
        np.testing.assert_allclose(ours, expected[axis], rtol=0, atol=1e-3)
        np.testing.assert_allclose(ours, twin[axis], rtol=0, atol=1e-3)


def test_a_rotation_that_is_not_quite_orthonormal_is_read_as_opencv_reads_it() -> None:
    rig = random_rig(1, 5, "pinhole", SIZE)
    rig.R = rig.R + np.random.default_rng(0).normal(0, 1e-5, (3, 3))
    for ours, theirs in zip(rig.rectified()[:2], opencv_rectify(rig, 0.0)[:2], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8)


def test_an_already_rectified_rig_stays_as_it_is() -> None:
    K = np.array([[800.0, 0, 479.5], [0, 800.0, 359.5], [0, 0, 1]])
    R1, R2, P1, P2 = _core.stereo_rectify("pinhole", K, [], K, [], np.eye(3), [-5, 0, 0], *SIZE, 0.0)
    np.testing.assert_array_equal(R1, np.eye(3))
    np.testing.assert_array_equal(R2, np.eye(3))
    np.testing.assert_allclose(P1[:, :3], K, rtol=1e-12)
    assert P2[0, 3] == pytest.approx(-4000.0)


def test_rays_that_point_backwards_have_no_source() -> None:
    K = np.array([[100.0, 0, 50], [0, 100.0, 50], [0, 0, 1]])
    P = np.hstack([np.array([[10.0, 0, 50], [0, 10.0, 50], [0, 0, 1]]), np.zeros((3, 1))])
    turned = rotation(np.array([0.0, 0.8, 0.0]))  # columns far to one side look past 90 degrees
    map_x, map_y = _core.undistort_map("pinhole", K, np.zeros(5), turned, P, 101, 101)
    assert np.isnan(map_x).any()
    np.testing.assert_array_equal(np.isnan(map_x), np.isnan(map_y))


GOOD = {
    "model": "pinhole",
    "K1": np.array([[800.0, 0, 480], [0, 800.0, 360], [0, 0, 1]]),
    "D1": np.zeros(5),
    "K2": np.array([[800.0, 0, 480], [0, 800.0, 360], [0, 0, 1]]),
    "D2": np.zeros(5),
    "R": np.eye(3),
    "T": np.array([-5.0, 0, 0]),
    "width": 960,
    "height": 720,
    "alpha": 0.0,
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "orthographic"}, "model: must be pinhole or fisheye"),
        ({"K1": np.eye(4)}, "left matrix: must hold 9 numbers"),
        ({"K1": np.array([[800.0, 3, 480], [0, 800.0, 360], [0, 0, 1]])}, "left matrix: must be"),
        ({"K2": np.diag([-800.0, 800.0, 1])}, "right matrix: the focal lengths must be positive"),
        ({"K1": np.array([[800.0, 0, np.nan], [0, 800.0, 360], [0, 0, 1]])}, "left matrix: every value must be finite"),
        ({"D1": np.zeros(6)}, "left distortion: must hold 0, 4, 5 or 8 coefficients"),
        ({"model": "fisheye", "D1": np.zeros(5)}, "left distortion: must hold 0 or 4 coefficients"),
        ({"D2": np.full(5, np.inf)}, "right distortion: every value must be finite"),
        ({"R": np.zeros((3, 3))}, "rotation: must be orthonormal"),
        ({"R": np.diag([1.0, 1.0, -1.0])}, "rotation: must not mirror"),
        ({"R": np.full((3, 3), np.nan)}, "rotation: every value must be finite"),
        ({"T": np.zeros(3)}, "translation: must not be zero"),
        ({"T": np.array([0.1, -5, 0])}, "translation: the cameras must lie side by side"),
        ({"T": np.array([np.inf, 0, 0])}, "translation: every value must be finite"),
        ({"width": 1}, "size: must be at least 2x2"),
        ({"alpha": 1.5}, "alpha: must be at most 1"),
        ({"alpha": np.nan}, "alpha: must be at most 1"),
        ({"model": "fisheye", "D1": np.zeros(4), "D2": np.zeros(4), "alpha": -1.0}, "alpha: must be 0 to 1"),
    ],
)
def test_bad_numbers_are_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match="; got ") as caught:
        _core.stereo_rectify(**(GOOD | change))
    assert str(caught.value).startswith(message)
    assert _core.stereo_rectify(**GOOD)[2][0, 0] == pytest.approx(800.0)
