"""Check a rig, and correct it, from frames of tissue alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from endosdk import _core
from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.live.frames import Frame
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.rig_error import Angles, RigError

OF_LENSES = (_core.Cause.SCALES_DIFFER, _core.Cause.DISTORTED)  # what no turn of a camera mends
MISFITS = (_core.Cause.RIG_MOVED, _core.Cause.NOT_RECTIFIED, *OF_LENSES)
PASSES = 2  # of a correction: the second one finds what the first left


@dataclass(frozen=True)
class RigCheck:
    """What frames tell of a rig: turns of the right camera against its calibration, degrees, with standard errors."""

    frames: int
    measured: int  # frames with enough to measure
    vertical_disparity_px: float  # median over the frames; NaN where none was measured
    rotation_deg: Angles
    rotation_se_deg: Angles
    drifted: bool
    causes: dict[str, int]  # frames that each cause was raised for

    @property
    def certain_deg(self) -> Angles:
        """The angles that chance does not explain; 0 for the others, which must not move a rig."""
        x, y, z = (
            angle if abs(angle) > _core.certain_standard_errors * error else 0.0
            for angle, error in zip(self.rotation_deg, self.rotation_se_deg, strict=True)
        )
        return x, y, z

    @property
    def fits(self) -> bool:
        """Whether the rig was measured, and neither the frames together nor most of them say that it does not fit."""
        return self.measured > 0 and not self.drifted and not self._in_most_frames(MISFITS)

    @property
    def lenses_fit(self) -> bool:
        """Whether most frames agree with the lens parameters and the scales that the calibration states."""
        return not self._in_most_frames(OF_LENSES)

    def _in_most_frames(self, causes: tuple[_core.Cause, ...]) -> bool:
        return any(2 * self.causes.get(cause.name, 0) > self.frames for cause in causes)


def check_rig(calibration: StereoCalibration, frames: Iterable[Frame], model: str = "fast") -> RigCheck:
    """Run a model over frames and return what they tell of the rig. Takes one frame's time each."""
    causes: dict[str, int] = {}
    rows: list[float] = []
    last: RigError | None = None
    count = 0
    with DepthEstimator(model, calibration=calibration) as estimator:
        for frame in frames:
            result = estimator.predict(frame.left, frame.right)
            count += 1
            for cause in result.causes:
                causes[cause.name] = causes.get(cause.name, 0) + 1
            if result.rig is not None and result.rig.steady_rotation_deg is not None:
                last = result.rig
                if _core.Cause.SAME_VIEW_TWICE not in result.causes:
                    rows.append(last.vertical_disparity_px)
    unknown = (math.nan, math.nan, math.nan)
    return RigCheck(
        frames=count,
        measured=len(rows),
        vertical_disparity_px=float(np.median(rows)) if rows else math.nan,
        rotation_deg=(last and last.steady_rotation_deg) or unknown,
        rotation_se_deg=(last and last.steady_rotation_se_deg) or unknown,
        drifted=last is not None and last.drifted,
        causes=causes,
    )


def refine_rig(
    calibration: StereoCalibration, frames: list[Frame], model: str = "fast"
) -> tuple[StereoCalibration, RigCheck, RigCheck]:
    """Return the corrected calibration, what was found before, and what the frames tell of the corrected rig.

    The calibration is returned as it is where a turn makes no frame's rows fit better, or where the lenses do not fit:
    the turn would only hide that.
    """
    given = calibration
    before = after = check_rig(calibration, frames, model)
    if not before.measured:
        rule = "must show tissue that can be measured in at least one pair"
        raise InvalidArgument("source", rule, f"{before.frames} frames, none measured")
    for _ in range(PASSES):
        turns = after.certain_deg
        if not any(turns):
            break
        corrected = calibration.turned(turns)
        found = check_rig(corrected, frames, model)
        # NaN where the corrected rig cannot be measured any more: that is no gain either.
        if not found.vertical_disparity_px < after.vertical_disparity_px:
            break
        calibration, after = corrected, found
    return calibration if after.lenses_fit else given, before, after
