"""Plain folders: one folder a pair, with pictures and truth alone, and no camera.

``left.png``, ``right.png`` and ``disparity.png`` (16 bits of 256 times the disparity in px, 0: unknown); optionally
``nonoccluded.png``, which is not 0 where both views see the point.
"""

from __future__ import annotations

import math
from pathlib import Path

from endosdk.datasets.dataset import RECORD, Sample, read_colours, read_disparity, read_gray, require_within_frame
from endosdk.datasets.layouts.public import PublicReader, require_size
from endosdk.errors import DatasetInvalid


class PlainReader(PublicReader):
    """Every such folder below the root, in either split; focal length and baseline of its samples are NaN."""

    layout = "plain"
    splits = ("train", "test")
    default_split = "test"
    pattern = "FOLDER/disparity.png"

    def find(self) -> dict[str, tuple[Path, ...]]:
        """List the folders."""
        ours = next(self.root.rglob(RECORD), None)
        if ours is not None:  # its test pairs are not for training
            rule = "must hold no dataset.json: a set that has one is of the layout endosdk, not plain"
            raise DatasetInvalid("dataset", rule, ours)
        found: dict[str, tuple[Path, ...]] = {}
        for truth in sorted(self.root.rglob("disparity.png")):
            folder = truth.parent
            name = folder.relative_to(self.root).as_posix() if folder != self.root else folder.resolve().name
            found[name] = (folder / "left.png", folder / "right.png", truth, folder / "nonoccluded.png")
        return found

    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read views, truth and the mask."""
        left, right, truth, mask = files
        disparity = read_disparity(truth)
        require_within_frame(truth, disparity)
        seen = read_gray(mask) > 0 if mask.exists() else None
        if seen is not None:
            require_size(mask, seen, disparity)
        return Sample(
            id=sample_id,
            left=read_colours(left),
            right=read_colours(right),
            disparity=disparity,
            disparity_right=None,
            occlusion=None if seen is None else ~seen,
            focal_px=math.nan,
            baseline_mm=math.nan,
            info={"layout": self.layout},
        )
