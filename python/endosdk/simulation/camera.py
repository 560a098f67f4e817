"""Where the two cameras are, and how they project: a pinhole rig and its pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.errors import InvalidArgument
from endosdk.simulation.curve import Floats

LARGEST_SIDE = 4096  # drawn at twice that, which every OpenGL can
LONGEST = 4  # ratio of the sides
WIDEST, NARROWEST = 0.1, 10.0  # focal length as a share of the width
BASELINES_MM = (0.1, 100.0)


@dataclass(frozen=True)
class StereoCamera:
    """A rectified pair: the right camera sits ``baseline_mm`` along the left one's x axis.

    Pixel centres have whole coordinates; the principal point is the middle of the image. The defaults are a 15 mm lens
    on a sensor 36 mm wide, and 10 mm between the lenses.
    """

    width: int = 960
    height: int = 720
    focal_px: float = 400.0
    baseline_mm: float = 10.0

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if not 16 <= getattr(self, name) <= LARGEST_SIDE:
                raise InvalidArgument(name, f"must be within 16..{LARGEST_SIDE} pixels", getattr(self, name))
        if not 1.0 / LONGEST <= self.height / self.width <= LONGEST:
            raise InvalidArgument("height", f"must be within 1/{LONGEST}..{LONGEST} times the width", self.height)
        if not WIDEST <= self.focal_px / self.width <= NARROWEST:
            rule = f"must be within {WIDEST}..{NARROWEST} times the width"
            raise InvalidArgument("focal_px", rule, self.focal_px)
        if not BASELINES_MM[0] <= self.baseline_mm <= BASELINES_MM[1]:
            rule = f"must be within {BASELINES_MM[0]}..{BASELINES_MM[1]} mm"
            raise InvalidArgument("baseline_mm", rule, self.baseline_mm)

    @property
    def matrix(self) -> Floats:
        """The camera matrix 3x3, the same for both."""
        return np.array(
            [[self.focal_px, 0, (self.width - 1) / 2], [0, self.focal_px, (self.height - 1) / 2], [0, 0, 1.0]]
        )

    def depth_of(self, disparity: float) -> float:
        """Return the depth in mm of a disparity in px."""
        return self.focal_px * self.baseline_mm / disparity

    def disparity_of(self, depth: float) -> float:
        """Return the disparity in px of a depth in mm."""
        return self.focal_px * self.baseline_mm / depth


@dataclass(frozen=True)
class View:
    """One pinhole camera placed in the rig: ``point_in_view = rotation @ point_in_rig + translation``."""

    matrix: Floats  # 3x3
    width: int
    height: int
    rotation: Floats  # 3x3
    translation: Floats  # (3,) mm


@dataclass(frozen=True)
class RectifiedPair:
    """Two views whose rows agree, and what turns depth into disparity; the rig's frame is the left view's."""

    left: View
    right: View
    focal_px: float
    baseline_mm: float

    def disparity(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return disparity [H,W] in px from planar depth [H,W] in mm; NaN where the depth is infinite."""
        disparity = np.asarray(self.focal_px * self.baseline_mm / depth.astype(np.float64), np.float32)
        return np.where(disparity > 0, disparity, np.float32(np.nan)).astype(np.float32)


def rectified_pair(camera: StereoCamera) -> RectifiedPair:
    """Return the two views of an ideal rig."""
    return aligned_pair(camera.matrix, camera.width, camera.height, camera.baseline_mm)


def aligned_pair(matrix: Floats, width: int, height: int, baseline_mm: float) -> RectifiedPair:
    """Return two parallel views with one camera matrix, ``baseline_mm`` apart."""
    left = View(matrix, width, height, np.eye(3), np.zeros(3))
    right = View(matrix, width, height, np.eye(3), np.array([-baseline_mm, 0.0, 0.0]))
    return RectifiedPair(left, right, float(matrix[0, 0]), baseline_mm)


@dataclass(frozen=True)
class Pose:
    """The rig inside the organ: position of the left camera, and its axes (x right, y down, z forward) as rows."""

    position: Floats  # (3,) organ mm
    axes: Floats  # 3x3


def look(position: Floats, target: Floats, roll: float) -> Pose:
    """Return the pose at ``position`` that looks at ``target``, rolled by an angle in radians."""
    forward = target - position
    forward = forward / np.linalg.norm(forward)
    hint = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.95 else np.array([1.0, 0.0, 0.0])
    right = np.cross(hint, forward)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    turn = np.cos(roll) * right + np.sin(roll) * down
    return Pose(position, np.stack([turn, np.cross(forward, turn), forward]))
