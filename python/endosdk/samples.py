"""The rendered raw pairs that come with the package: what demo and benchmark run on, with exact truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.calibration import StereoCalibration
from endosdk.dataset import read_disparity
from endosdk.image_files import read_frame


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
        """Return the pair as a camera of another size would give it; the truth is resampled without mixing surfaces."""
        import cv2

        old_height, old_width = self.left.shape[:2]
        if (old_width, old_height) == (width, height):
            return self

        def resize(view: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
            return np.asarray(cv2.resize(view, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)

        truth = cv2.resize(self.disparity, (width, height), interpolation=cv2.INTER_NEAREST) * (width / old_width)
        return RawPair(
            resize(self.left), resize(self.right), self.calibration.scaled(width, height), truth.astype(np.float32)
        )


# Copied into a wheel; a link to the repository's examples/data in an editable install.
FOLDER = Path(__file__).parent / "_samples"


def sample_rig() -> Path:
    """Return the calibration file of the rig that took all pairs."""
    return FOLDER / "rig.json"


def sample_pairs() -> list[RawPair]:
    """Read every pair that came with the package, in the order of their names."""
    rig = StereoCalibration.load(sample_rig())
    return [
        RawPair(
            read_frame(disparity.with_name("left.png")),
            read_frame(disparity.with_name("right.png")),
            rig,
            read_disparity(disparity),
        )
        for disparity in sorted(FOLDER.glob("*/disparity.png"))
    ]
