"""SERV-CT: sixteen pairs of a da Vinci endoscope with truth from CT (Edwards, Psychogyios et al., 2022).

``Experiment_1`` and ``Experiment_2`` hold ``Left_rectified``, ``Right_rectified``, ``Rectified_calibration`` and a
reference folder with ``Disparity``, ``DepthL`` and ``OcclusionL``, all named by number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.dataset import Sample, read_colours, read_disparity, read_json, require_within_frame
from endosdk.datasets.layouts.public import PublicReader, finite, positive, require_size
from endosdk.errors import DatasetInvalid

_REFERENCES = ("Reference_CT", "Ground_truth_CT")  # the name differs between releases


class ServCtReader(PublicReader):
    """All pairs, with the CT reference. What was not scanned has no truth; what one view alone sees is occluded."""

    layout = "servct"
    splits = ("test",)
    default_split = "test"
    pattern = "Experiment_*/Left_rectified/*.png"

    def find(self) -> dict[str, tuple[Path, ...]]:
        """List the pairs of every experiment that lies there."""
        found: dict[str, tuple[Path, ...]] = {}
        for experiment in sorted(self.root.glob("Experiment_*")):
            reference = next((experiment / name for name in _REFERENCES if (experiment / name).is_dir()), None)
            if reference is None:
                raise DatasetInvalid("dataset", f"{experiment.name} must hold {' or '.join(_REFERENCES)}", self.root)
            for left in sorted((experiment / "Left_rectified").glob("*.png")):
                found[f"{experiment.name}/{left.stem}"] = (
                    left,
                    experiment / "Right_rectified" / left.name,
                    reference / "Disparity" / left.name,
                    reference / "OcclusionL" / left.name,
                    experiment / "Rectified_calibration" / f"{left.stem}.json",
                )
        return found

    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read views, truth, the coloured occlusion picture and the calibration."""
        left, right, truth, occlusion, calibration = files
        first, second = _projections(calibration)
        focal = positive(calibration, "focal length", float(first[0, 0]))
        disparity = read_disparity(truth)
        require_within_frame(truth, disparity)
        hidden = None
        if occlusion.exists():
            colours = read_colours(occlusion)
            require_size(occlusion, colours, disparity)
            red, green, blue = (colours[..., channel] > 127 for channel in range(3))
            # Red: only the left view sees it. Yellow: outside the overlap. Blue: outside the scan.
            hidden = red & ~blue
            disparity = np.where(blue & ~red & ~green, np.float32(np.nan), disparity)
        return Sample(
            id=sample_id,
            left=read_colours(left),
            right=read_colours(right),
            disparity=disparity,
            disparity_right=None,
            occlusion=hidden,
            focal_px=focal,
            baseline_mm=positive(calibration, "baseline", (float(first[0, 3]) - float(second[0, 3])) / focal),
            doffs=finite(calibration, "offset of the principal points", float(second[0, 2]) - float(first[0, 2])),
            info={"layout": self.layout},
        )


def _projections(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        record = read_json(path, "sample")
        return _matrix(record["P1"]), _matrix(record["P2"])
    except DatasetInvalid:
        raise
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        rule = f"{path.name} must be JSON with the projections P1 and P2, 3x4"
        raise DatasetInvalid("sample", rule, f"{error!r}") from error


def _matrix(value: Any) -> NDArray[np.float64]:
    """Read rows of numbers, or OpenCV's record of a matrix."""
    return np.array(value["data"] if isinstance(value, dict) else value, dtype=np.float64).reshape(3, 4)
