"""StereoSGBM, the matcher everyone already has: the method beside which endosdk's numbers are stated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument

FloatMap = npt.NDArray[np.float32]
RANGE = 80  # disparities that are searched, px, unless told otherwise


@dataclass(frozen=True)
class SgbmSettings:
    """Settings of OpenCV's semi-global matcher on gray pictures (its documentation explains each)."""

    max_disparity: int = RANGE  # a multiple of 16, px
    block_size: int = 5
    uniqueness_ratio: int = 5
    speckle_window: int = 100
    speckle_range: int = 2
    left_right_tolerance: int = 1
    eight_paths: bool = False  # the slower, better variant (HH) instead of three paths
    # Costs of a step of one plane and of more, per pixel of the block: OpenCV's P1 and P2 are these times its area.
    small_step: int = 8
    large_step: int = 32
    pre_filter: int = 0  # at which the gradient is cut off; OpenCV takes at least 15

    def __post_init__(self) -> None:
        """Check what OpenCV would refuse without naming it."""
        if self.max_disparity < 16 or self.max_disparity % 16:
            raise InvalidArgument("max_disparity", "must be a multiple of 16, at least 16", self.max_disparity)


class SgbmBaseline:
    """OpenCV's StereoSGBM with sub-pixel output and holes as NaN."""

    def __init__(self, settings: SgbmSettings | None = None) -> None:
        import cv2

        s = settings or SgbmSettings()
        self.settings = s
        self._matcher: Any = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=s.max_disparity,
            blockSize=s.block_size,
            P1=s.small_step * s.block_size**2,
            P2=s.large_step * s.block_size**2,
            preFilterCap=s.pre_filter,
            disp12MaxDiff=s.left_right_tolerance,
            uniquenessRatio=s.uniqueness_ratio,
            speckleWindowSize=s.speckle_window,
            speckleRange=s.speckle_range,
            mode=cv2.STEREO_SGBM_MODE_HH if s.eight_paths else cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def compute(self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8]) -> FloatMap:
        """Disparity, px, float32 [H, W] of a rectified RGB pair uint8 [H, W, 3]; NaN where it gives no answer."""
        return matched(self._matcher, left, right, self.settings.max_disparity)


def matched(matcher: Any, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], max_disparity: int) -> FloatMap:
    """Return what a matcher of OpenCV that searches so many px finds in a rectified RGB pair: `SgbmBaseline.compute`.

    Raises InvalidArgument for pictures that are narrower than the search.
    """
    import cv2

    if left.shape[1] <= max_disparity:
        raise InvalidArgument("left", f"must be wider than {max_disparity} px", left.shape[1])
    gray = [cv2.cvtColor(view, cv2.COLOR_RGB2GRAY) for view in (left, right)]
    fixed = matcher.compute(*gray)
    return np.where(fixed > 0, fixed.astype(np.float32) / 16, np.float32(np.nan)).astype(np.float32)


def fill_holes(disparity: FloatMap) -> FloatMap:
    """Fill each hole of a row with the smaller (farther) of its two neighbours, as hidden background is.

    Rows without any answer take the row above, or zero.
    """
    height, width = disparity.shape
    columns = np.arange(width)
    filled = np.empty_like(disparity)
    above = np.zeros(width, np.float32)
    for row in range(height):
        known = np.isfinite(disparity[row])
        if known.any():
            before = np.maximum.accumulate(np.where(known, columns, -1))
            after = np.minimum.accumulate(np.where(known, columns, width)[::-1])[::-1]
            left_value = np.where(before >= 0, disparity[row, np.maximum(before, 0)], np.inf)
            right_value = np.where(after < width, disparity[row, np.minimum(after, width - 1)], np.inf)
            above = np.minimum(left_value, right_value).astype(np.float32)
        filled[row] = above
    return filled
