"""The rendered raw pairs that come with the package: what demo and benchmark run on, with exact truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration
from endosdk.datasets.dataset import read_disparity
from endosdk.errors import InvalidArgument
from endosdk.io.pictures import read_frame

# Sizes that a camera may have, px a side: in smaller or narrower pictures there is nothing left to match.
SIDES = (64, 8192)
LARGEST_ASPECT = 4


@dataclass(frozen=True)
class RawPair:
    """A raw, distorted, misaligned pair, RGB uint8 [H, W, 3], with its rig.

    ``disparity`` is the truth of the rectified left view, px, float32 [H, W], NaN where there is none.
    """

    left: npt.NDArray[np.uint8]
    right: npt.NDArray[np.uint8]
    calibration: StereoCalibration
    disparity: npt.NDArray[np.float32]

    def resized(self, width: int, height: int) -> RawPair:
        """Return the pair as a camera of another size would give it.

        Both views are cut to the largest window of that aspect ratio in their middle, which is then resized. That is
        another rig with another rectified geometry: the truth is brought there, each pixel from the nearest, so that no
        two surfaces mix, and is NaN where the truth of the whole pair ends. Raises InvalidArgument for a size that no
        camera has.
        """
        import cv2

        if (self.calibration.width, self.calibration.height) == (width, height):
            return self
        short, long = sorted((width, height))
        if short < SIDES[0] or long > SIDES[1] or long > LARGEST_ASPECT * short:
            rule = f"must be {SIDES[0]} to {SIDES[1]} px a side, one side at most {LARGEST_ASPECT} times the other"
            raise InvalidArgument("size", rule, f"{width}x{height}")
        x, y, wide, high = self.window(width, height)

        def resize(view: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
            cut = view[y : y + high, x : x + wide]
            method = cv2.INTER_AREA if width < wide else cv2.INTER_LINEAR
            return np.asarray(cv2.resize(cut, (width, height), interpolation=method), dtype=np.uint8)

        rig = self.calibration.cropped(x, y, wide, high).scaled(width, height)
        truth = _truth_in(self.disparity, self.calibration.rectification(), rig.rectification())
        return RawPair(resize(self.left), resize(self.right), rig, truth)

    def window(self, width: int, height: int) -> tuple[int, int, int, int]:
        """Return (x, y, width, height) of the largest window in the middle that has the aspect ratio of a size, px."""
        old_width, old_height = self.calibration.width, self.calibration.height
        wide = min(old_width, round(old_height * width / height))
        high = min(old_height, round(old_width * height / width))
        return (old_width - wide) // 2, (old_height - high) // 2, wide, high


def _truth_in(
    disparity: npt.NDArray[np.float32], seen: RectifiedGeometry, wanted: RectifiedGeometry
) -> npt.NDArray[np.float32]:
    """Bring the disparity [H, W], px, of one rectified left view to another of the same two camera centres.

    Rectifying rotations follow from how the cameras stand to each other, which no crop or resize changes: the two views
    differ in focal length and principal point alone, column by column and row by row.
    """
    old, new = seen.P1, wanted.P1
    rows, columns = (
        np.rint((np.arange(size) - new[axis, 2]) * (old[axis, axis] / new[axis, axis]) + old[axis, 2]).astype(np.intp)
        for axis, size in ((1, wanted.height), (0, wanted.width))
    )
    inside = ((rows >= 0) & (rows < seen.height))[:, None] & ((columns >= 0) & (columns < seen.width))
    nearest = disparity[rows.clip(0, seen.height - 1)[:, None], columns.clip(0, seen.width - 1)]
    moved = (nearest + seen.doffs) * (wanted.focal_px / seen.focal_px) - wanted.doffs
    return np.where(inside, moved, np.nan).astype(np.float32)


# Copied into a wheel; a link to the repository's examples/data in an editable install.
FOLDER = Path(__file__).parents[1] / "_samples"


def sample_pairs() -> list[RawPair]:
    """Read every pair that came with the package, in the order of their names."""
    rig = StereoCalibration.load(FOLDER / "rig.json")  # it took all pairs
    return [
        RawPair(
            read_frame(disparity.with_name("left.png")),
            read_frame(disparity.with_name("right.png")),
            rig,
            read_disparity(disparity),
        )
        for disparity in sorted(FOLDER.glob("*/disparity.png"))
    ]
