"""KITTI stereo 2012 and 2015 (Geiger et al., CVPR 2012; Menze and Geiger, CVPR 2015).

``training/`` of 2015 holds ``image_2``, ``image_3``, ``disp_occ_0``, ``disp_noc_0`` and ``calib_cam_to_cam``; that of
2012 ``colored_0``, ``colored_1`` (or gray ``image_0``, ``image_1``), ``disp_occ``, ``disp_noc`` and ``calib``. The
truth of ``testing/`` is not published.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.dataset import Sample, read_colours, read_disparity, read_text, require_within_frame
from endosdk.datasets.layouts.public import PublicReader, positive, require_size
from endosdk.errors import DatasetInvalid


class _Edition(NamedTuple):
    left: str
    right: str
    truth: str
    visible: str
    calibration: str
    cameras: tuple[str, str]  # keys of the projections of the left and the right view


_EDITIONS = (
    _Edition("image_2", "image_3", "disp_occ_0", "disp_noc_0", "calib_cam_to_cam", ("P_rect_02", "P_rect_03")),
    _Edition("colored_0", "colored_1", "disp_occ", "disp_noc", "calib", ("P2", "P3")),
    _Edition("image_0", "image_1", "disp_occ", "disp_noc", "calib", ("P0", "P1")),
)


class KittiReader(PublicReader):
    """The first frame (``_10``) of each training scene; baseline in mm although the files hold metres."""

    layout = "kitti"
    splits = ("train",)
    default_split = "train"
    pattern = "training/{image_2,disp_occ_0}/*_10.png, or those of 2012 in colored_0 or image_0 and disp_occ"

    def find(self) -> dict[str, tuple[Path, ...]]:
        """List the frames of the edition that lies there."""
        base = self.root / "training" if (self.root / "training").is_dir() else self.root
        for edition in _EDITIONS:
            if (base / edition.left).is_dir() and (base / edition.truth).is_dir():
                self.edition = edition
                return {
                    path.stem: (
                        base / edition.left / path.name,
                        base / edition.right / path.name,
                        path,
                        base / edition.visible / path.name,
                        base / edition.calibration / f"{path.stem.removesuffix('_10')}.txt",
                    )
                    for path in sorted((base / edition.truth).glob("*_10.png"))
                }
        return {}

    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read views, both truths and the projections."""
        left, right, truth, visible, calibration = files
        disparity = read_disparity(truth)
        require_within_frame(truth, disparity)
        occlusion = None
        if visible.exists():
            seen = read_disparity(visible)
            require_size(visible, seen, disparity)
            # The second map leaves out what the right view does not see.
            occlusion = np.isfinite(disparity) & ~np.isfinite(seen)
        first, second = (_projection(calibration, key) for key in self.edition.cameras)
        focal = positive(calibration, "focal length", float(first[0, 0]))
        return Sample(
            id=sample_id,
            left=read_colours(left),
            right=read_colours(right),
            disparity=disparity,
            disparity_right=None,
            occlusion=occlusion,
            focal_px=focal,
            baseline_mm=positive(calibration, "baseline", 1e3 * (float(first[0, 3]) - float(second[0, 3])) / focal),
            info={"layout": self.layout, "edition": self.edition.left},
        )


def _projection(path: Path, key: str) -> NDArray[np.float64]:
    try:
        lines = dict(line.split(":", 1) for line in read_text(path, "sample").splitlines() if ":" in line)
        return np.array([float(word) for word in lines[key].split()]).reshape(3, 4)
    except DatasetInvalid:
        raise
    except (ValueError, KeyError) as error:
        raise DatasetInvalid("sample", f"{path.name} must hold the twelve numbers of {key}", f"{error!r}") from error
