"""Stereo rigs that several tests build, read and write."""

from __future__ import annotations

from typing import Any

import numpy as np

from endosdk.calibration.rig import StereoCalibration


def rotation(x: float, y: float, z: float) -> np.ndarray:
    """Rotation matrix of a rotation vector in radians (Rodrigues)."""
    axis = np.array([x, y, z])
    angle = float(np.linalg.norm(axis))
    if angle == 0:
        return np.eye(3)
    k = axis / angle
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rig_fields(**changes: Any) -> dict[str, Any]:
    """Fields of a raw, slightly misaligned laparoscope; ``changes`` replace single ones."""
    fields = {
        "width": 640,
        "height": 480,
        "left_matrix": np.array([[520.5, 0, 318.25], [0, 521.75, 241.5], [0, 0, 1]]),
        "right_matrix": np.array([[519.25, 0, 322.125], [0, 520.0, 236.75], [0, 0, 1]]),
        "left_distortion": np.array([-0.21, 0.11, 0.0011, -0.0007, -0.03]),
        "right_distortion": np.array([-0.19, 0.09, -0.0005, 0.0009, -0.02]),
        "rotation": rotation(0.011, -0.023, 0.007),
        "translation": np.array([-4.6, 0.12, 0.31]),
    }
    return {**fields, **changes}


def raw_rig(**changes: Any) -> StereoCalibration:
    """The calibration of `rig_fields`."""
    return StereoCalibration(**rig_fields(**changes))


def fisheye_rig() -> StereoCalibration:
    """The same rig with fisheye lenses."""
    distortion = np.array([-0.02, 0.004, -0.001, 0.0002])
    return raw_rig(left_distortion=distortion, right_distortion=distortion * 0.9, model="fisheye")
