"""What the pictures tell of the rig: rows that do not match, and the rotation that explains them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from endosdk import _core

Angles = tuple[float, float, float]


@dataclass(frozen=True)
class RigError:
    """How far the rig of one pair stands from its calibration.

    Rotations are those of the right camera in the rectified frame, as a vector about x (right), y (down) and z
    (forward), degrees: by so much the points that it sees turned, so it turned the other way itself. They are None
    without a calibration, which gives the focal length that they need.
    """

    vertical_disparity_px: float  # root mean square over the picture
    vertical_disparity_se_px: float  # standard error
    rotation_deg: Angles | None  # of this frame alone
    rotation_se_deg: Angles | None
    steady_rotation_deg: Angles | None  # over the frames so far, corrections not counted
    steady_rotation_se_deg: Angles | None
    drifted: bool  # the steady rotation is over 0.1 degree, and no chance
    corrected_deg: Angles  # what the rectification of this frame made up for: see `DepthEstimator.stream`


def rig_error(report: _core.FrameReport, calibrated: bool) -> RigError | None:
    """Return what a frame's report says of the rig; None where too little of the pair could be measured."""
    if report.pose is None:
        return None
    _, _, rows, rows_se = report.pose
    # None before the first frame that counts: docs/python.md says which do.
    steady = report.steady if calibrated else None
    return RigError(
        vertical_disparity_px=rows,
        vertical_disparity_se_px=rows_se,
        rotation_deg=_angles(report.pose) if calibrated else None,
        rotation_se_deg=_errors(report.pose) if calibrated else None,
        steady_rotation_deg=None if steady is None else _angles(steady),
        steady_rotation_se_deg=None if steady is None else _errors(steady),
        drifted=calibrated and report.drifted,
        corrected_deg=_degrees(report.corrected),
    )


def _degrees(radians: Any) -> Angles:
    x, y, z = (math.degrees(value) for value in radians[:3])
    return x, y, z


def _angles(pose: Any) -> Angles:
    return _degrees(pose[0])


def _errors(pose: Any) -> Angles:
    size = len(pose[0])
    return _degrees([math.sqrt(pose[1][i * (size + 1)]) for i in range(3)])
