"""How well a calibration knows its numbers, and what that means for a depth in mm.

The covariance of all numbers of the rig follows from the slopes of the projection, ``s^2 (J' J)^-1``, with the slopes
by the board's poses taken out. The size ``s`` of the corners' errors is what the fit leaves. That takes the errors of
corners as independent, which they are not, most of all on a ChArUco board: its corners follow from its markers. Views
are independent. So the whole is widened by how much more the numbers move when one view after another is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from endosdk.calibration.boards import BoardView
from endosdk.calibration.rectified_points import rectify_points
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import EndoError

Matrix = npt.NDArray[np.float64]

CAMERA = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
NAMES = (
    *(f"left {name}" for name in CAMERA),
    *(f"right {name}" for name in CAMERA),
    *(f"rotation {axis}" for axis in "xyz"),
    *(f"translation {axis}" for axis in "xyz"),
)
POSE = 6
DEPTHS_MM = (30.0, 60.0, 100.0)
DRAWS = 200
LEAST_LEFT_OUT = 6  # views, for leaving out one to say anything
EDGE = 0.7  # where the edge is: this share of the way from the middle of the picture to its corner


@dataclass(frozen=True, eq=False)
class ParameterErrors:
    """``covariance`` [22,22] of the rig's numbers, named by `NAMES`: px, 1, radians and mm.

    ``depth_mm`` says for each of `DEPTHS_MM` how far the depth of a surface there is uncertain by them, one standard
    deviation: in the middle of the picture, and towards its corners.
    """

    covariance: Matrix
    depth_mm: dict[float, tuple[float, float]]

    @property
    def standard_errors(self) -> dict[str, float]:
        """The standard error of every number."""
        return dict(zip(NAMES, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


def parameter_errors(
    calibration: StereoCalibration, views: Sequence[BoardView], poses: Sequence[tuple[Matrix, Matrix]]
) -> ParameterErrors:
    """Return the errors of a pinhole rig that was fitted to these views; ``poses`` are (rotation vector, place)."""
    normals, gradients = np.zeros((len(views), len(NAMES), len(NAMES))), np.zeros((len(views), len(NAMES)))
    squares, residuals = 0.0, 0
    for i, (view, pose) in enumerate(zip(views, poses, strict=True)):
        error, slopes = _view_slopes(calibration, view, pose)
        by_rig, by_pose = slopes[:, : len(NAMES)], np.linalg.qr(slopes[:, len(NAMES) :])[0]
        by_rig = by_rig - by_pose @ (by_pose.T @ by_rig)
        normals[i], gradients[i] = by_rig.T @ by_rig, by_rig.T @ error
        squares += float(error @ error)
        residuals += error.size - POSE
    inverse: Matrix = np.asarray(np.linalg.inv(normals.sum(axis=0)), np.float64)
    covariance = squares / max(residuals - len(NAMES), 1) * inverse
    covariance *= _widening(normals, gradients, np.diag(covariance))
    return ParameterErrors(covariance, {depth: _depth_error(calibration, covariance, depth) for depth in DEPTHS_MM})


def _widening(normals: Matrix, gradients: Matrix, variances: Matrix) -> float:
    """Return how much larger the variances are that leaving out each view gives: a mean over all numbers, or 1."""
    count = len(normals)
    if count < LEAST_LEFT_OUT:
        return 1.0
    moved = np.array([np.linalg.solve(normals.sum(axis=0) - n, g) for n, g in zip(normals, gradients, strict=True)])
    found = (count - 1) / count * (moved**2).sum(axis=0)
    return max(1.0, float(np.exp(np.mean(np.log(found / variances)))))


def _view_slopes(calibration: StereoCalibration, view: BoardView, pose: tuple[Matrix, Matrix]) -> tuple[Matrix, Matrix]:
    """Return residuals [4N] of a view and their slopes [4N, 22 + 6] by the rig's numbers and the board's pose."""
    import cv2

    c, k = calibration, len(CAMERA)
    turn, place = (np.asarray(part, np.float64).reshape(3, 1) for part in pose)
    between = cv2.Rodrigues(c.rotation)[0]
    composed = cv2.composeRT(turn, place, between, c.translation.reshape(3, 1))
    right_turn, right_place = (np.asarray(part, np.float64) for part in composed[:2])
    # The slopes of the right pose: by the board's pose, and by the pose between the cameras. Rotations stand first.
    by_board = np.block([[composed[2], composed[3]], [composed[6], composed[7]]])
    by_rig = np.block([[composed[4], composed[5]], [composed[8], composed[9]]])
    slopes = np.zeros((4 * view.count, len(NAMES) + POSE))
    left, left_pose, left_camera = _projected(view.board, turn, place, c.left_matrix, c.left_distortion)
    right, right_pose, right_camera = _projected(
        view.board, right_turn, right_place, c.right_matrix, c.right_distortion
    )
    half = 2 * view.count
    slopes[:half, :k] = left_camera
    slopes[half:, k : 2 * k] = right_camera
    slopes[half:, 2 * k : 2 * k + POSE] = right_pose @ by_rig
    slopes[:half, len(NAMES) :] = left_pose
    slopes[half:, len(NAMES) :] = right_pose @ by_board
    return np.concatenate([(left - view.left).ravel(), (right - view.right).ravel()]), slopes


def _projected(
    points: Matrix, turn: Matrix, place: Matrix, matrix: Matrix, distortion: Matrix
) -> tuple[Matrix, Matrix, Matrix]:
    """Return pixels [N,2], their slopes [2N,6] by the pose and [2N,8] by `CAMERA`."""
    import cv2

    coefficients = np.zeros(5)
    coefficients[: min(distortion.size, 5)] = distortion[:5]
    pixels, slopes = cv2.projectPoints(points[:, None], turn, place, matrix, coefficients)[:2]
    by_all: Matrix = np.asarray(slopes, np.float64)
    return np.asarray(pixels, np.float64).reshape(-1, 2), by_all[:, :6], by_all[:, 6:14]


def _depth_error(calibration: StereoCalibration, covariance: Matrix, depth_mm: float) -> tuple[float, float]:
    """Return the standard deviation of a depth over rigs drawn by the covariance, in the middle and at the edge."""
    g = calibration.rectification()
    half = np.array([g.width, g.height]) / 2
    places = half + EDGE * half * np.array([[0, 0], [-1, -1], [1, -1], [1, 1], [-1, 1]])
    rays = np.column_stack([(places - (g.cx, g.cy)) / g.focal_px, np.ones(len(places))])
    points = rays * depth_mm @ g.R1  # in the raw left camera
    raw = _raw_pixels(calibration, points)
    drawn = [_moved(calibration, step) for step in _steps(covariance)]
    depths = np.array([_triangulated(rig, *raw) for rig in drawn if rig is not None])
    if len(depths) < DRAWS // 2:
        return float("nan"), float("nan")
    spread = depths.std(axis=0)
    return float(spread[0]), float(np.sqrt((spread[1:] ** 2).mean()))


def _steps(covariance: Matrix) -> Matrix:
    """Draw [DRAWS,22] steps of the rig's numbers.

    The numbers have very different sizes, so that the root is taken of their correlation. What rounding has left of it
    below zero is none.
    """
    sizes = np.sqrt(np.diag(covariance))
    shares, directions = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    root = directions * np.sqrt(np.maximum(shares, 0.0))
    steps: Matrix = np.random.default_rng(0).standard_normal((DRAWS, len(sizes))) @ root.T * sizes
    return steps


def _raw_pixels(calibration: StereoCalibration, points: Matrix) -> tuple[Matrix, Matrix]:
    import cv2

    c, none = calibration, np.zeros(3)
    right = points @ c.rotation.T + c.translation
    seen_left = cv2.projectPoints(points, none, none, c.left_matrix, c.left_distortion)[0]
    seen_right = cv2.projectPoints(right, none, none, c.right_matrix, c.right_distortion)[0]
    return np.asarray(seen_left, np.float64).reshape(-1, 2), np.asarray(seen_right, np.float64).reshape(-1, 2)


def _moved(calibration: StereoCalibration, step: Matrix) -> StereoCalibration | None:
    """Return the rig whose numbers differ by ``step``, in the order of `NAMES`; None where that is no rig."""
    import cv2

    c, k = calibration, len(CAMERA)
    cameras = []
    for matrix, distortion, part in (
        (c.left_matrix, c.left_distortion, step[:k]),
        (c.right_matrix, c.right_distortion, step[k : 2 * k]),
    ):
        changed = matrix.copy()
        changed[[0, 1, 0, 1], [0, 1, 2, 2]] += part[:4]
        coefficients = np.zeros(5)
        coefficients[: distortion.size] = distortion[:5]
        coefficients[:4] += part[4:]
        cameras.append((changed, coefficients))
    turned = cv2.Rodrigues(c.rotation)[0].ravel() + step[2 * k : 2 * k + 3]
    turn = np.asarray(cv2.Rodrigues(turned)[0], np.float64)
    (k1, d1), (k2, d2) = cameras
    try:
        return StereoCalibration(c.width, c.height, k1, k2, d1, d2, turn, c.translation + step[2 * k + 3 :])
    except EndoError:
        return None


def _triangulated(calibration: StereoCalibration, left: Matrix, right: Matrix) -> Matrix:
    """Return the depth of matching raw pixels, mm."""
    a, b = rectify_points(calibration, left, right)
    return calibration.rectification().depth_of(a[:, 0] - b[:, 0])
