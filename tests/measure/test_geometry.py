"""Raw and rectified pixels, both ways, against OpenCV and against each other."""

import re

import cv2
import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.measure import points_in_raw_left_camera, q_matrix, raw_to_rectified, rectified_to_raw, valid_region
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import fisheye_rig, raw_rig

PIXELS = np.stack(np.meshgrid(np.linspace(5, 634, 9), np.linspace(5, 474, 7)), axis=-1)


@pytest.mark.parametrize("rig", [raw_rig(), fisheye_rig()], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_there_and_back(rig, side):
    there = raw_to_rectified(rig, PIXELS, side)
    assert there.shape == PIXELS.shape
    assert rectified_to_raw(rig, there, side) == pytest.approx(PIXELS, abs=1e-6)


def test_the_map_of_opencv_says_the_same():
    rig = raw_rig()
    g = rig.rectification(alpha=1.0)
    x, y = cv2.initUndistortRectifyMap(
        rig.left_matrix, rig.left_distortion, g.R1, g.P1[:, :3], (g.width, g.height), cv2.CV_32FC1
    )
    for column, row in ((0, 0), (320, 240), (600, 31)):
        assert rectified_to_raw(rig, (column, row), alpha=1.0) == pytest.approx(
            (x[row, column], y[row, column]), abs=0.01
        )


def test_where_the_lens_model_folds_there_is_no_pixel():
    matrix = np.array([[700.0, 0, 479.5], [0, 700.0, 359.5], [0, 0, 1]])
    lens = np.array([-0.45, 0, 0, 0])
    rig = StereoCalibration(960, 720, matrix, matrix, lens, lens, np.eye(3), np.array([-4.0, 0, 0]))
    columns = np.array([(x, 359.5) for x in (480, 600, 700, 900, 950)])
    raw = rectified_to_raw(rig, columns, alpha=1.0)
    known = np.isfinite(raw[:, 0])
    assert known.tolist() == [True, True, True, False, False]
    assert (np.diff(raw[known, 0]) > 0).all()


@pytest.mark.parametrize("turn", [raw_to_rectified, rectified_to_raw])
def test_pixels_that_are_no_numbers_and_none_at_all_go_through_as_in_c(turn):
    known = turn(raw_rig(), (320, 240))
    found = turn(raw_rig(), [(np.nan, 240), (320, 240), (np.inf, 3)])
    assert np.isnan(found[[0, 2]]).all()
    assert found[1] == pytest.approx(known)
    for none, shape in (([], (0, 2)), (np.empty((4, 0, 2)), (4, 0, 2))):
        assert turn(raw_rig(), none).shape == shape


def test_a_point_projects_to_the_raw_pixel_it_came_from():
    rig = raw_rig()
    g = rig.rectification()
    raw = np.array([[200.0, 150.0], [500.0, 300.0]])
    rectified = raw_to_rectified(rig, raw)
    sights = np.column_stack([(rectified - (g.cx, g.cy)) / g.focal_px, np.ones(2)])
    points = points_in_raw_left_camera(g, sights * [[70.0], [55.0]])
    again, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), rig.left_matrix, rig.left_distortion)
    assert again.reshape(-1, 2) == pytest.approx(raw, abs=1e-6)


def test_q_gives_the_points_of_the_result():
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96), cx=70.0, doffs=0.25)
    result = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(*shifted_pair(96, 160, 10))
    points = cv2.reprojectImageTo3D(result.disparity, q_matrix(rig.rectification()))
    assert np.array_equal(q_matrix(rig), q_matrix(rig.rectification()))
    valid = result.reasons == 0
    assert valid.mean() > 0.5
    assert points[valid] == pytest.approx(result.points()[valid], rel=1e-4)


def test_valid_region_is_covered_and_cannot_grow():
    rig = raw_rig()
    x, y, width, height = valid_region(rig, alpha=1.0)
    g = rig.rectification(alpha=1.0)
    edge = np.array([[i, j] for i in np.linspace(x, x + width - 1, 20) for j in (y, y + height - 1)])
    for side in ("left", "right"):
        raw = rectified_to_raw(rig, edge, side, alpha=1.0)
        assert (raw > -0.51).all()
        assert (raw < (rig.width - 0.49, rig.height - 0.49)).all()
    assert 0.3 * g.width * g.height < width * height < g.width * g.height
    for left, top, right, bottom in ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)):
        columns = np.arange(x - left, x + width + right)
        rows = np.arange(y - top, y + height + bottom)
        grown = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(float)
        raws = [rectified_to_raw(rig, grown, side, alpha=1.0) for side in ("left", "right")]
        seen = [((raw >= 0) & (raw <= (rig.width - 1, rig.height - 1))).all(axis=1) for raw in raws]
        inside = ((grown >= 0) & (grown < (g.width, g.height))).all(axis=1)
        assert not (seen[0] & seen[1] & inside).all(), "one row or column more is not covered"
    assert valid_region(StereoCalibration.rectified(200.0, 5.0, (160, 96))) == (0, 0, 160, 96)


def test_wrong_arguments_are_refused():
    with pytest.raises(InvalidArgument, match="side"):
        raw_to_rectified(raw_rig(), (1, 1), "middle")
    for turn in (raw_to_rectified, rectified_to_raw):
        with pytest.raises(InvalidArgument, match=r"pixels: must be \(x, y\), \[\.\.\., 2\]; got shape \(3,\) \["):
            turn(raw_rig(), [1, 2, 3])
        with pytest.raises(InvalidArgument, match=r"pixels: must be \(x, y\), .*; got \[\('a', 3\)\] \["):
            turn(raw_rig(), [("a", 3)])
        with pytest.raises(InvalidArgument, match=r"pixels: must be \(x, y\), .*; got \[\(1, 2\), \(3,\)\] \["):
            turn(raw_rig(), [(1, 2), (3,)])
    with pytest.raises(InvalidArgument, match=r"geometry: must be a RectifiedGeometry, .*; got StereoCalibration \["):
        points_in_raw_left_camera(raw_rig(), [(1, 2, 3)])
    for points, seen in (((1, 2), "shape (2,)"), ("a", "'a'"), ([(1, 2, None)], "[(1, 2, None)]")):
        with pytest.raises(InvalidArgument, match=rf"points: must be \(x, y, z\), .*; got {re.escape(seen)} \["):
            points_in_raw_left_camera(raw_rig().rectification(), points)
    with pytest.raises(InvalidArgument, match="square"):
        q_matrix(StereoCalibration.rectified(200.0, 5.0, (160, 96)).scaled(80, 96).rectification())
