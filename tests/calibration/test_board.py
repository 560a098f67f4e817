"""Calibration from a chessboard: on rendered corners with known truth, and on the real boards."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from endosdk.calibration.board import calibrate_board, find_corners, rectify_points, row_correlation, same_order
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument
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


def corners_of(rig: StereoCalibration) -> tuple[list[np.ndarray], list[np.ndarray]]:
    left, right = [], []
    for turn, place in POSES:
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


@pytest.mark.parametrize(("count", "square"), [(2, SQUARE), (4, 0.0), (4, -1.0), (4, float("nan"))])
def test_too_few_pairs_or_no_square_is_refused(count: int, square: float) -> None:
    left, right = corners_of(raw_rig())
    with pytest.raises(InvalidArgument):
        calibrate_board(left[:count], right[:count], PATTERN, square, (640, 480))
