"""Boards as a rig with known numbers sees them: every pixel's ray is met with the board's plane."""

from __future__ import annotations

import cv2
import numpy as np

from endosdk.calibration.boards import Board
from endosdk.calibration.rig import StereoCalibration
from tests.rigs import rotation

Picture = np.ndarray
PIXELS_PER_MM = 12.0
# Turn (radians) and where the board's middle lies (mm): tilted both ways, in all parts of the picture, near and far.
POSES = (
    ((0.0, 0.0, 0.0), (0, 0, 62)),
    ((0.5, 0.0, 0.1), (-9, -6, 58)),
    ((-0.5, 0.1, 0.0), (9, 6, 60)),
    ((0.0, 0.5, -0.1), (9, -6, 56)),
    ((0.1, -0.5, 0.2), (-9, 6, 60)),
    ((0.4, 0.4, 0.0), (0, 7, 52)),
    ((-0.4, -0.4, 0.3), (0, -7, 70)),
    ((0.3, -0.4, -0.3), (-11, 0, 66)),
    ((-0.3, 0.4, 0.4), (11, 0, 64)),
    ((0.2, 0.2, 0.8), (0, 0, 75)),
)


def shown(board: Board, rig: StereoCalibration, pose: tuple, noise: float = 1.0, seed: int = 0) -> list[Picture]:
    """Both views, uint8 [H, W, 3], of a board whose middle lies at a place before the left camera."""
    rng = np.random.default_rng(seed)
    turn, place = rotation(*pose[0]), np.asarray(pose[1], float)
    views = []
    for side, between, shift in (("left", np.eye(3), np.zeros(3)), ("right", rig.rotation, rig.translation)):
        matrix, distortion = getattr(rig, f"{side}_matrix"), getattr(rig, f"{side}_distortion")
        views.append(_view(board, rig, matrix, distortion, between @ turn, between @ place + shift, noise, rng))
    return views


def _view(board, rig, matrix, distortion, turn, place, noise, rng) -> Picture:
    x, y = np.meshgrid(np.arange(rig.width, dtype=float), np.arange(rig.height, dtype=float))
    pixels = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 1e-9)
    flat = cv2.undistortPoints(pixels, matrix, distortion, R=np.eye(3), P=np.eye(3), criteria=stop).reshape(-1, 2)
    rays = np.column_stack([flat, np.ones(len(flat))]) @ turn
    origin = -place @ turn
    far = -origin[2] / rays[:, 2]
    met = origin[:2] + far[:, None] * rays[:, :2]  # on the board, mm from its middle
    printed = board.picture(PIXELS_PER_MM)
    middle = (np.array(printed.shape[::-1]) - 1) / 2
    at = (met * PIXELS_PER_MM + middle).astype(np.float32).reshape(rig.height, rig.width, 2)
    soft = cv2.GaussianBlur(printed, (0, 0), 1.2)
    seen = cv2.remap(soft, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=90)
    seen = 20 + 0.8 * seen.astype(float) + rng.normal(0, noise, seen.shape)
    return np.repeat(np.clip(seen, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
