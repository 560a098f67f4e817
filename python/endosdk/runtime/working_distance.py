"""How near a surface may come to a rig before each shipped model finds it no more."""

from __future__ import annotations

import math

from endosdk import _core
from endosdk.calibration.rig import StereoCalibration
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession


def nearest_depths(calibration: StereoCalibration) -> dict[str, float | None]:
    """Nearest depth, mm, by name of the shipped model, at the size at which it usually sees the rig's frames.

    None where a model does not state its range. Raises RuntimeMissing without ONNX Runtime.
    """
    depths: dict[str, float | None] = {}
    for name in shipped_models():
        info = StereoSession(read_model(name)).info
        end, width = info.max_candidate_disparity or 0, info.inference_width or 0
        nearest = _core.nearest_depth_mm(calibration.numbers(), end, width)
        depths[name] = None if math.isnan(nearest) else nearest
    return depths
