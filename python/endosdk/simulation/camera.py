"""Where the two cameras are, and how they project: a pinhole rig and its pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.simulation.curve import Floats


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
            if getattr(self, name) < 16:
                raise InvalidArgument(name, "must be at least 16 pixels", getattr(self, name))
        for name in ("focal_px", "baseline_mm"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InvalidArgument(name, "must be positive", getattr(self, name))

    @property
    def matrix(self) -> Floats:
        """The camera matrix 3x3, the same for both."""
        return np.array(
            [[self.focal_px, 0, (self.width - 1) / 2], [0, self.focal_px, (self.height - 1) / 2], [0, 0, 1.0]]
        )


@dataclass(frozen=True)
class View:
    """One pinhole camera placed in the rig: ``point_in_view = rotation @ point_in_rig + translation``."""

    matrix: Floats  # 3x3
    width: int
    height: int
    rotation: Floats  # 3x3
    translation: Floats  # (3,) mm


def rectified_views(camera: StereoCamera) -> tuple[View, View]:
    """Return the left and right view of an ideal rig whose frame is the left camera's."""
    left = View(camera.matrix, camera.width, camera.height, np.eye(3), np.zeros(3))
    right = View(camera.matrix, camera.width, camera.height, np.eye(3), np.array([-camera.baseline_mm, 0.0, 0.0]))
    return left, right


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
