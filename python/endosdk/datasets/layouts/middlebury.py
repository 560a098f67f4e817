"""Middlebury stereo: 2014 and 2021 scenes and the folders of the third evaluation (Scharstein et al., GCPR 2014).

A scene is a folder with ``im0.png``, ``im1.png``, ``calib.txt`` and the truth as PFM: ``disp0.pfm`` (and ``disp1.pfm``)
in the scenes as published, ``disp0GT.pfm`` with ``mask0nocc.png`` in the evaluation's ``training*`` folders.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.dataset import (
    Sample,
    find_occlusion,
    read_colours,
    read_gray,
    read_text,
    require_within_frame,
    unknown_match,
)
from endosdk.datasets.layouts.pfm import read_pfm
from endosdk.datasets.layouts.public import PublicReader, finite, positive, require_size
from endosdk.errors import DatasetInvalid

_TRUTHS = ("disp0.pfm", "disp0GT.pfm")


class MiddleburyReader(PublicReader):
    """Every scene with truth below the root; the name of a scene is its folder."""

    layout = "middlebury"
    splits = ("train",)
    default_split = "train"
    pattern = f"SCENE/calib.txt with {' or '.join(_TRUTHS)}"

    def find(self) -> dict[str, tuple[Path, ...]]:
        """List the scenes."""
        found = {}
        for calibration in sorted(self.root.rglob("calib.txt")):
            scene = calibration.parent
            truth = next((scene / name for name in _TRUTHS if (scene / name).exists()), None)
            if truth is not None:
                files = ("im0.png", "im1.png", truth.name, "disp1.pfm", "mask0nocc.png", "calib.txt")
                name = scene.relative_to(self.root).as_posix() if scene != self.root else scene.resolve().name
                found[name] = tuple(scene / file for file in files)
        return found

    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read views, truth and calibration; occlusion from the mask, or else from the truth of both views."""
        left, right, truth, truth_right, mask, calibration = files
        numbers = _calibration(calibration)
        disparity = _read_truth(truth)
        other = _read_truth(truth_right) if truth_right.exists() else None
        if other is not None:
            require_size(truth_right, other, disparity)
        occlusion: NDArray[np.bool_] | None = None
        if mask.exists():
            occlusion = read_gray(mask) == 128  # 255: both views see it; 0: no truth
            require_size(mask, occlusion, disparity)
        elif other is not None:
            # The truth of the right view has holes of its own, which hide nothing.
            occlusion = find_occlusion(disparity, other) & ~unknown_match(disparity, other)
        return Sample(
            id=sample_id,
            left=read_colours(left),
            right=read_colours(right),
            disparity=disparity,
            disparity_right=other,
            occlusion=occlusion,
            focal_px=numbers["focal"],
            baseline_mm=numbers["baseline"],
            doffs=numbers["doffs"],
            info={"layout": self.layout},
        )


def _read_truth(path: Path) -> NDArray[np.float32]:
    """Read the disparities of a view, which are infinite where they are not known."""
    disparity = read_pfm(path)
    if np.isnan(disparity).any():
        raise DatasetInvalid("sample", f"{path} must hold numbers, or inf where there is no truth", "nan")
    require_within_frame(path, disparity)
    return np.where(np.isfinite(disparity) & (disparity > 0), disparity, np.float32(np.nan)).astype(np.float32)


def _calibration(path: Path) -> dict[str, float]:
    try:
        lines = dict(line.split("=", 1) for line in read_text(path, "sample").splitlines() if "=" in line)
        focal = float(lines["cam0"].strip().lstrip("[").split()[0])
        return {
            "focal": positive(path, "focal length", focal),
            "baseline": positive(path, "baseline", float(lines["baseline"])),
            "doffs": finite(path, "doffs", float(lines["doffs"])),
        }
    except DatasetInvalid:
        raise
    except (ValueError, KeyError, IndexError) as error:
        raise DatasetInvalid("sample", f"{path} must hold cam0, doffs and baseline", f"{error!r}") from error
