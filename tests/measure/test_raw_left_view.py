"""Depth over the raw left view: against planes whose depth in both cameras OpenCV knows, and point by point."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.errors import CalibrationRequired, InvalidArgument
from endosdk.io.pictures import read_frame
from endosdk.measure import RawLeftView, points_in_raw_left_camera, raw_to_rectified, rectified_to_raw
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.rigs import fisheye_rig, raw_rig, rotation

EXAMPLES = ROOT / "examples" / "data"
NORMAL = np.array([0.2, -0.1, 1.0])  # of a plane in the raw left camera: NORMAL @ point = 60 mm
PLANE_MM = 60.0


@pytest.fixture(scope="module")
def demo() -> tuple[StereoCalibration, DepthResult]:
    rig = StereoCalibration.load(EXAMPLES / "rig.json")
    pair = (read_frame(EXAMPLES / "demo" / f"{side}.png") for side in ("left", "right"))
    return rig, DepthEstimator("fast", calibration=rig).predict(*pair)


def of_the_plane(rig: StereoCalibration) -> DepthResult:
    """A result whose depth is that of the plane, as the rectified camera sees it."""
    result = DepthEstimator(TINY_MODEL, calibration=rig).predict(*shifted_pair(480, 640, 12))
    g = rig.rectification()
    rows, columns = np.indices((480, 640))
    sights = np.stack([(columns - g.cx) / g.focal_px, (rows - g.cy) / g.focal_y_px, np.ones((480, 640))], axis=-1)
    depth = (PLANE_MM / (sights @ g.R1 @ NORMAL)).astype(np.float32)
    return replace(result, maps=result.maps._replace(depth=depth, sigma=depth / 100))


def test_raw_pixels_that_no_ray_reaches_have_no_place() -> None:
    """The lens model bends back at 0.70 focal lengths; the corners of the frame lie at 1.2."""
    lens = np.array([-0.3, 0.0, 0.0, 0.0, 0.0])
    matrix = np.array([[500.0, 0, 479.5], [0, 500.0, 359.5], [0, 0, 1]])
    rig = StereoCalibration(960, 720, matrix, matrix, lens, lens, np.eye(3), np.array([-5.0, 0.0, 0.0]))
    pixels = np.stack(np.meshgrid(np.arange(0, 960, 7.0), np.arange(0, 720, 7.0)), axis=-1).reshape(-1, 2)
    places = raw_to_rectified(rig, pixels)
    known = np.isfinite(places).all(axis=1)
    radius = np.hypot(*((pixels - matrix[:2, 2]) / 500).T)
    assert not known[radius > 0.71].any() and known[radius < 0.5].all()
    np.testing.assert_allclose(rectified_to_raw(rig, places[known]), pixels[known], atol=0.01)


@pytest.mark.parametrize("lens", ["pinhole", "fisheye"])
def test_the_depth_of_a_plane_is_that_along_the_raw_axis(lens: str) -> None:
    turned = {"rotation": rotation(0.02, -0.06, 0.03), "translation": np.array([-4.6, 0.4, 0.9])}
    rig = replace(raw_rig() if lens == "pinhole" else fisheye_rig(), **turned)
    result, view = of_the_plane(rig), RawLeftView(rig)
    found, sigma = view.depth(result), view.sigma(result)
    assert found.shape == (480, 640) and found.dtype == sigma.dtype == np.float32
    pixels = np.indices((480, 640))[::-1].reshape(2, 1, -1).T.astype(float)
    undistort = cv2.undistortPoints if lens == "pinhole" else cv2.fisheye.undistortPoints
    sights = undistort(pixels, rig.left_matrix.copy(), rig.left_distortion.copy()).reshape(480, 640, 2)
    expected = PLANE_MM / (sights @ NORMAL[:2] + NORMAL[2])
    known = np.isfinite(found)
    assert known.mean() > 0.5
    # The nearest pixel is up to half a pixel to either side, where the plane is up to 0.03 mm nearer or farther.
    np.testing.assert_allclose(found[known], expected[known], rtol=6e-4)
    np.testing.assert_allclose(sigma[known], found[known] / 100, rtol=1e-4)
    # Along the rectified axis it would be another.
    there = np.rint(raw_to_rectified(rig, (60.0, 400.0))).astype(int)
    assert abs(result.depth[there[1], there[0]] / expected[400, 60] - 1) > 0.01


def test_every_pixel_is_what_the_functions_of_points_say(demo) -> None:
    rig, result = demo
    found = RawLeftView(rig).depth(result)
    rng = np.random.default_rng(5)
    raw = np.column_stack([rng.integers(0, 960, 4000), rng.integers(0, 720, 4000)])
    there = raw_to_rectified(rig, raw)
    columns, rows = np.rint(there).astype(int).T
    inside = (columns >= 0) & (columns < 960) & (rows >= 0) & (rows < 720)
    depth = np.full(4000, np.nan)
    depth[inside] = result.depth[rows[inside], columns[inside]]
    g = result.geometry
    points = np.column_stack([(there - (g.cx, g.cy)) / g.focal_px, np.ones(4000)]) * depth[:, None]
    expected = points_in_raw_left_camera(g, points)[:, 2]
    assert 0.5 < np.isfinite(expected).mean() < 0.95 and not inside.all()
    np.testing.assert_allclose(found[raw[:, 1], raw[:, 0]], expected, rtol=1e-5)


def test_over_a_rectified_view_the_depth_is_that_of_the_result() -> None:
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    result = DepthEstimator(TINY_MODEL, calibration=rig).predict(*shifted_pair(96, 160, 12))
    view = RawLeftView(rig)
    assert np.array_equal(view.depth(result), result.depth, equal_nan=True)
    assert np.array_equal(view.sigma(result), result.sigma, equal_nan=True)


def test_where_the_lens_model_folds_there_is_no_depth() -> None:
    matrix = np.array([[700.0, 0, 319.5], [0, 700.0, 239.5], [0, 0, 1]])
    lens = np.array([-1.2, 0, 0, 0])  # rays beyond 0.35 rad fold back: nothing falls on the corners
    rig = StereoCalibration(640, 480, matrix, matrix, lens, lens, np.eye(3), np.array([-4.0, 0, 0]))
    found = RawLeftView(rig).depth(of_the_plane(rig))
    assert np.isnan(found[0, 0]) and np.isfinite(found[240, 320])


def test_a_result_of_another_rig_or_of_none_is_refused(demo) -> None:
    _, result = demo
    with pytest.raises(
        InvalidArgument, match=f"result: must be of the rig of this view.*got {result.calibration_sha256}"
    ):
        RawLeftView(raw_rig()).depth(result)
    with pytest.raises(CalibrationRequired, match="depth"):
        RawLeftView(raw_rig()).depth(DepthEstimator(TINY_MODEL).predict(*shifted_pair(480, 640, 12)))
