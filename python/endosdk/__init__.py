"""Stereo depth for binocular endoscopes: a pair of frames in, disparity, metric depth and trust out.

Importing this package loads NumPy and one small compiled module; onnxruntime and OpenCV load when first needed.
"""

from endosdk.runtime import telemetry

telemetry.disable()  # before anything can import onnxruntime: later is too late

from endosdk._core import version as __version__  # noqa: E402
from endosdk.calibration.rig import StereoCalibration  # noqa: E402
from endosdk.errors import EndoError, ErrorCode  # noqa: E402
from endosdk.live.sources import open_source  # noqa: E402
from endosdk.runtime.estimator import DepthEstimator  # noqa: E402
from endosdk.runtime.models import shipped_models  # noqa: E402
from endosdk.runtime.result import Cause, DepthResult, Reason, Status  # noqa: E402

__all__ = [
    "Cause",
    "DepthEstimator",
    "DepthResult",
    "EndoError",
    "ErrorCode",
    "Reason",
    "Status",
    "StereoCalibration",
    "__version__",
    "open_source",
    "shipped_models",
]


def __dir__() -> list[str]:
    return __all__
