"""Effects of real cameras that are off unless asked for: motion blur and chroma subsampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import Pose
from endosdk.simulation.curve import Floats

MOST_INSTANTS = 8


@dataclass(frozen=True)
class Effects:
    """What a real camera adds."""

    motion_px: float = 0.0  # single pairs: longest streak that a turn of the hand leaves while the shutter is open
    shutter: float = 0.0  # video: share of the time between two frames that the shutter is open
    chroma: bool = False  # one colour for four pixels, as in 4:2:0 video

    def __post_init__(self) -> None:
        if not 0 <= self.motion_px <= 50:
            raise InvalidArgument("motion_px", "must be within 0..50 px", self.motion_px)
        if not 0 <= self.shutter <= 1:
            raise InvalidArgument("shutter", "must be within 0..1", self.shutter)


def turning(pose: Pose, motion_px: float, focal_px: float, seed: int) -> tuple[Pose, ...]:
    """Return the poses of a hand that turns while the shutter is open, around ``pose`` in the middle."""
    import cv2

    if motion_px == 0:
        return (pose,)
    rng = np.random.default_rng((seed, 10))
    streak = motion_px * float(rng.uniform(0.2, 1.0))
    axis: Floats = rng.normal(size=3) * np.array([1.0, 1.0, 0.3])
    turn = axis / np.linalg.norm(axis) * streak / focal_px
    count = int(np.clip(np.ceil(streak) + 1, 2, MOST_INSTANTS))
    return tuple(
        Pose(pose.position, np.asarray(cv2.Rodrigues(turn * step)[0], np.float64) @ pose.axes)
        for step in np.linspace(-0.5, 0.5, count)
    )


def subsample_chroma(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return RGB [H,W,3] after the colour of each 2 x 2 pixels was averaged; brightness keeps every pixel."""
    import cv2

    height, width = picture.shape[:2]
    coded = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2YCrCb))
    small = cv2.resize(coded[..., 1:], ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA)
    coded[..., 1:] = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(coded, cv2.COLOR_YCrCb2RGB), np.uint8)
