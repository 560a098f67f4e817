"""Calibration from a chessboard: on rendered corners with known truth, and on the real boards."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from endosdk.calibration.board import (
    calibrate_board,
    calibrate_views,
    find_corners,
    rectify_points,
    row_correlation,
    same_order,
)
from endosdk.calibration.boards import Board, BoardView, find_view
from endosdk.calibration.parameter_errors import NAMES
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument, InvalidCalibration
from tests.rigs import fisheye_rig, raw_rig, rotation

PATTERN, SQUARE = (9, 6), 3.0
POSES = (
    ((0.0, 0.0, 0.0), (-12.0, -8.0, 55.0)),
    ((0.4, -0.3, 0.1), (-14.0, -6.0, 70.0)),
    ((-0.35, 0.4, -0.2), (-9.0, -9.0, 60.0)),
    ((0.2, 0.5, 0.6), (-6.0, -10.0, 65.0)),
    ((-0.5, -0.2, -0.4), (-13.0, -3.0, 62.0)),
    ((0.1, -0.6, 0.3), (-10.0, -8.0, 75.0)),
)


def board_points() -> np.ndarray:
    columns, rows = PATTERN
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    return np.hstack([grid * SQUARE, np.zeros((len(grid), 1))])


def pixels(rig: StereoCalibration, camera: str, points: np.ndarray) -> np.ndarray:
    """Project points [N,3] of the camera's own frame with OpenCV."""
    import cv2

    matrix, distortion = getattr(rig, f"{camera}_matrix"), getattr(rig, f"{camera}_distortion")
    project = cv2.projectPoints if rig.model == "pinhole" else cv2.fisheye.projectPoints
    arguments = (np.zeros(3), np.zeros(3), matrix.copy(), distortion.reshape(1, -1).copy())
    return project(points.reshape(-1, 1, 3), *arguments)[0].reshape(-1, 2)


Poses = Sequence[tuple[tuple[float, float, float], tuple[float, float, float]]]


def corners_of(rig: StereoCalibration, poses: Poses = POSES) -> tuple[list[np.ndarray], list[np.ndarray]]:
    left, right = [], []
    for turn, place in poses:
        seen = board_points() @ rotation(*turn).T + np.array(place)
        left.append(pixels(rig, "left", seen))
        right.append(pixels(rig, "right", seen @ rig.rotation.T + rig.translation))
    return left, right


def test_exact_corners_give_the_rig_back() -> None:
    coefficients = np.array([-0.2, 0.1, 0.001, -0.0007])
    rig = raw_rig(left_distortion=coefficients, right_distortion=coefficients * 0.8)
    result = calibrate_board(*corners_of(rig), PATTERN, SQUARE, (rig.width, rig.height))
    assert result.reprojection_px < 1e-2
    assert result.row_median_px < 1e-2 and result.row_p95_px < 2e-2
    np.testing.assert_allclose(result.calibration.translation, rig.translation, atol=5e-3)
    np.testing.assert_allclose(result.calibration.rotation, rig.rotation, atol=2e-4)
    np.testing.assert_allclose(result.calibration.left_matrix, rig.left_matrix, atol=0.5)


@pytest.mark.parametrize("rig", [raw_rig(), fisheye_rig()], ids=["pinhole", "fisheye"])
def test_points_of_the_true_rig_share_their_rows(rig: StereoCalibration) -> None:
    left, right = corners_of(rig)
    median, p95 = row_correlation(rig, left, right)
    assert median < 1e-3 and p95 < 5e-3
    tilted = dataclasses.replace(rig, translation=rig.translation + np.array([0, 0.05, 0]))
    assert row_correlation(tilted, left, right)[0] > 0.1


def test_triangulated_depth_of_the_true_rig() -> None:
    rig = raw_rig()
    turn, place = POSES[1]
    seen = board_points() @ rotation(*turn).T + np.array(place)
    left, right = rectify_points(rig, corners_of(rig)[0][1], corners_of(rig)[1][1])
    geometry = rig.rectification()
    depth = geometry.focal_px * geometry.baseline_mm / (left[:, 0] - right[:, 0] + geometry.doffs)
    np.testing.assert_allclose(depth, (seen @ geometry.R1.T)[:, 2], rtol=1e-4)


def test_corners_found_upside_down_are_turned_back() -> None:
    left, right = (side[0] for side in corners_of(raw_rig()))
    np.testing.assert_array_equal(same_order(left, right), right)
    np.testing.assert_array_equal(same_order(left, right[::-1]), right)


def test_corners_of_a_drawn_board_are_found() -> None:
    columns, rows, side = 7, 5, 24
    cells = np.indices((rows + 1, columns + 1)).sum(axis=0) % 2
    board = np.kron(np.where(cells, 230, 20).astype(np.uint8), np.ones((side, side), np.uint8))
    picture = np.pad(board, 30, constant_values=230)
    corners = find_corners(picture, (columns, rows))
    assert corners is not None
    expected = np.stack(np.meshgrid(np.arange(1, columns + 1), np.arange(1, rows + 1)), axis=-1).reshape(-1, 2)
    # Rows or columns may be counted from either end; each drawn corner must have one found within half a pixel.
    gaps = np.linalg.norm(corners[:, None] - (expected * side + 29.5), axis=2)
    assert gaps.min(axis=0).max() < 0.5 and len(corners) == columns * rows
    assert find_corners(np.full((200, 200, 3), 128, np.uint8), (columns, rows)) is None


@pytest.mark.parametrize(
    "poses",
    [
        [((0.0, 0.0, 0.0), (-14.0 + i, -8.0, 60.0)) for i in range(6)],
        [((0.0, 0.0, 0.2 * i), (-14.0 + i, -8.0, 60.0)) for i in range(6)],
        6 * [POSES[0]],
        6 * [POSES[1]],
    ],
    ids=["frontal", "turned in its plane", "copies", "copies of a tilted one"],
)
@pytest.mark.parametrize("seed", range(6))
def test_a_board_that_was_not_tilted_is_called_that(poses: Poses, seed: int) -> None:
    rig, rng = plain_rig(), np.random.default_rng(seed)
    left, right = ([one + rng.normal(0, 0.1, one.shape) for one in side] for side in corners_of(rig, poses))
    with pytest.raises(InvalidArgument, match=r"pairs: must show enough .*: tilt the board more.*; got 6 that"):
        calibrate_board(left, right, PATTERN, SQUARE, (rig.width, rig.height))


def test_swapped_cameras_are_called_that() -> None:
    left, right = corners_of(plain_rig())
    with pytest.raises(InvalidCalibration, match="the cameras are swapped"):
        calibrate_board(right, left, PATTERN, SQUARE, (640, 480))


@pytest.mark.parametrize(("count", "square"), [(2, SQUARE), (4, 0.0), (4, -1.0), (4, float("nan"))])
def test_too_few_pairs_or_no_square_is_refused(count: int, square: float) -> None:
    left, right = corners_of(raw_rig())
    with pytest.raises(InvalidArgument):
        calibrate_board(left[:count], right[:count], PATTERN, square, (640, 480))


def noisy_views(rig: StereoCalibration, sigma: float, seed: int) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    shown = zip(*corners_of(rig), strict=True)
    return [
        BoardView(f"view {i}", board_points(), a + rng.normal(0, sigma, a.shape), b + rng.normal(0, sigma, b.shape))
        for i, (a, b) in enumerate(shown)
    ]


def plain_rig() -> StereoCalibration:
    coefficients = np.array([-0.2, 0.1, 0.001, -0.0007])
    return raw_rig(left_distortion=coefficients, right_distortion=coefficients * 0.8)


def test_stated_errors_are_those_of_repeated_calibrations() -> None:
    """Corners with noise of 0.1 px, drawn again and again: each number strays as far as its standard error says."""
    rig = plain_rig()
    true = {"left fx": rig.left_matrix[0, 0], "right cx": rig.right_matrix[0, 2], "left k1": -0.2}
    true |= {"translation x": rig.translation[0], "translation z": rig.translation[2]}
    scores = []
    for seed in range(8):
        found = calibrate_views(noisy_views(rig, 0.1, seed), (rig.width, rig.height))
        assert found.errors is not None and not found.refused
        c, errors = found.calibration, found.errors.standard_errors
        numbers = {"left fx": c.left_matrix[0, 0], "right cx": c.right_matrix[0, 2], "left k1": c.left_distortion[0]}
        numbers |= {"translation x": c.translation[0], "translation z": c.translation[2]}
        scores.append([(numbers[name] - true[name]) / errors[name] for name in true])
        assert errors.keys() == set(NAMES)
    assert 0.4 < float(np.mean(np.square(scores))) < 2.0


def test_depth_errors_hold_against_the_true_rig() -> None:
    """What the parameters' errors mean in mm: depths that noisy calibrations give to points of the true rig."""
    rig = plain_rig()
    point = np.array([[0.0, 0.0, 60.0]])
    raw = pixels(rig, "left", point), pixels(rig, "right", point @ rig.rotation.T + rig.translation)
    scores = []
    for seed in range(6):
        found = calibrate_views(noisy_views(rig, 0.1, 50 + seed), (rig.width, rig.height))
        g = found.calibration.rectification()
        a, b = rectify_points(found.calibration, *raw)
        depth = g.focal_px * g.baseline_mm / (a[0, 0] - b[0, 0] + g.doffs)
        true = (point @ g.R1.T)[0, 2]
        assert found.errors is not None
        middle, edge = found.errors.depth_mm[60.0]
        assert edge > 0
        near = found.errors.depth_mm[30.0][0]
        assert near < found.errors.depth_mm[100.0][0]
        scores.append((depth - true) / middle)
    assert float(np.sqrt(np.mean(np.square(scores)))) < 2.5


def test_a_board_that_was_hardly_tilted_gives_large_errors() -> None:
    """Its covariance is singular but for rounding: that is no reason for a warning of NumPy."""
    rig, rng = plain_rig(), np.random.default_rng(4)
    turns = [(*0.02 * rng.normal(size=2), 0.2 * i) for i in range(6)]
    poses = [(turn, (-14.0 + i, -8.0, 60.0)) for i, turn in enumerate(turns)]
    left, right = ([one + rng.normal(0, 0.1, one.shape) for one in side] for side in corners_of(rig, poses))
    errors = calibrate_board(left, right, PATTERN, SQUARE, (rig.width, rig.height)).errors
    assert errors is not None and min(errors.depth_mm[60.0]) > 2


def test_views_that_do_not_fit_are_refused_one_by_one() -> None:
    rig = plain_rig()
    views = noisy_views(rig, 0.05, 1)
    views += [replace(view, name=f"again {i}") for i, view in enumerate(noisy_views(rig, 0.05, 2))]
    views[3] = replace(views[3], right=views[3].right + np.array([0.0, 6.0]))  # the pictures of two moments
    views[8] = replace(views[8], left=views[8].left + np.linspace(0, 8, 54)[:, None])
    found = calibrate_views(views, (rig.width, rig.height))
    assert set(found.refused) == {"view 3", views[8].name}
    assert "does not fit the others" in found.refused["view 3"]
    assert found.reprojection_px < 0.1
    assert found.view_px.keys() == {view.name for view in views} - found.refused.keys()
    np.testing.assert_allclose(found.calibration.translation, rig.translation, atol=0.05)


@pytest.mark.parametrize("marker_mm", [None, 2.2], ids=["chessboard", "charuco"])
def test_a_printed_board_is_found_and_numbered(marker_mm: float | None) -> None:
    board = Board((9, 6), 3.0, marker_mm)
    picture = board.picture(10.0)
    found = board.find(picture)
    assert len(found) == 54
    # The first corner lies two squares from the edge of the paper: one of margin, one of the board.
    places = np.array([found[i] for i in range(54)]) / 10.0
    gaps = np.linalg.norm(np.diff(places.reshape(6, 9, 2), axis=1), axis=2)
    assert gaps == pytest.approx(3.0, abs=0.05)
    if marker_mm is not None:
        assert places == pytest.approx(board.points()[:, :2] + 6.0, abs=0.1)
        part = np.full_like(picture, 255)
        part[:, : picture.shape[1] // 2] = picture[:, : picture.shape[1] // 2]
        assert 20 <= len(board.find(part)) < 40  # seen in part, and each corner keeps its number
        assert all(np.linalg.norm(board.find(part)[i] - found[i]) < 1.0 for i in board.find(part))


def test_a_view_says_why_it_is_none() -> None:
    blank = np.full((300, 400), 128, np.uint8)
    assert "no whole board in either view" in str(find_view(Board((9, 6), 3.0), "a", blank, blank))
    board = Board((9, 6), 3.0, 2.2)
    assert "0 of the same corners" in str(find_view(board, "a", board.picture(10.0), blank))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"pattern": (2, 6)}, "pattern"),
        ({"square_mm": 0.0}, "square_mm"),
        ({"marker_mm": 3.5}, "marker_mm"),
        ({"dictionary": "7X7"}, "dictionary"),
    ],
)
def test_a_board_that_cannot_be_is_refused(changes: dict[str, object], word: str) -> None:
    with pytest.raises(InvalidArgument, match=word):
        Board(**({"pattern": (9, 6), "square_mm": 3.0} | changes))  # type: ignore[arg-type]
