"""Check a rig, and correct it, from frames of tissue alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.live.frames import Frame
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.rig_error import Angles, RigError

CERTAIN = 4.0  # standard errors from which a rotation is no chance
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
    def certain(self) -> bool:
        """Whether any angle is further from 0 than chance explains."""
        pairs = zip(self.rotation_deg, self.rotation_se_deg, strict=True)
        return any(abs(angle) > CERTAIN * error for angle, error in pairs)


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
            if result.rig is not None:
                last = result.rig
                rows.append(last.vertical_disparity_px)
    unknown = (math.nan, math.nan, math.nan)
    return RigCheck(
        frames=count,
        measured=len(rows),
        vertical_disparity_px=float(np.median(rows)) if rows else math.nan,
        rotation_deg=unknown if last is None else last.steady_rotation_deg or unknown,
        rotation_se_deg=unknown if last is None else last.steady_rotation_se_deg or unknown,
        drifted=last is not None and last.drifted,
        causes=causes,
    )


def refine_rig(
    calibration: StereoCalibration, frames: list[Frame], model: str = "fast"
) -> tuple[StereoCalibration, RigCheck, RigCheck]:
    """Return the corrected calibration, what was found before, and what the frames tell of the corrected rig."""
    before = after = check_rig(calibration, frames, model)
    if not before.measured:
        rule = "must show tissue that can be measured in at least one pair"
        raise InvalidArgument("source", rule, f"{before.frames} frames, none measured")
    for _ in range(PASSES):
        if not after.certain:
            break
        calibration = calibration.turned(after.rotation_deg)
        after = check_rig(calibration, frames, model)
    return calibration, before, after
