"""Results for other libraries: Open3D and Rerun. Both are optional and load when first needed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import DependencyMissing, InvalidArgument
from endosdk.io.extras import must_install_package

if TYPE_CHECKING:
    from endosdk.runtime.result import DepthResult

Picture = npt.NDArray[np.uint8]


def to_open3d(result: DepthResult, left: Picture | None = None) -> Any:
    """Return the points of a result as an ``open3d.geometry.PointCloud``, mm, in the rectified left camera's frame.

    ``left``, RGB uint8 [H, W, 3] as `DepthEstimator.rectify` gives it, colours them. Raises CalibrationRequired,
    InvalidArgument, DependencyMissing.
    """
    points, known = _known_points(result)
    colours = None if left is None else _coloured(result, left)[known]
    try:
        import open3d
    except ImportError as error:
        raise DependencyMissing("open3d", must_install_package("open3d"), "nothing") from error
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
    if colours is not None:
        cloud.colors = open3d.utility.Vector3dVector(colours / 255.0)
    return cloud


def to_rerun(result: DepthResult, left: Picture | None = None, entity: str = "endosdk") -> None:
    """Log a result to the current recording of Rerun: camera, left view, depth and points, lengths in mm.

    Call ``rerun.init`` first, and ``rerun.set_time`` before each frame of a sequence. ``left`` is as in `to_open3d`.
    Raises CalibrationRequired, InvalidArgument, DependencyMissing.
    """
    points, known = _known_points(result)
    colours = None if left is None else _coloured(result, left)
    try:
        import rerun
    except ImportError as error:
        raise DependencyMissing("rerun-sdk", must_install_package("rerun-sdk"), "nothing") from error
    g = result.geometry
    assert g is not None  # _known_points has asked for it
    camera = rerun.Pinhole(
        focal_length=(g.focal_px, g.focal_y_px), principal_point=(g.cx, g.cy), resolution=(g.width, g.height)
    )
    rerun.log(f"{entity}/camera", camera)
    rerun.log(f"{entity}/camera/depth", rerun.DepthImage(np.nan_to_num(result.depth), meter=1000.0))
    if colours is not None:
        rerun.log(f"{entity}/camera/left", rerun.Image(colours))
    tints = None if colours is None else colours[known]
    rerun.log(f"{entity}/points", rerun.Points3D(points, colors=tints))


def _known_points(result: DepthResult) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    known = np.isfinite(result.depth)
    return result.points()[known], known


def _coloured(result: DepthResult, left: Picture) -> Picture:
    wanted = (*result.disparity.shape, 3)
    if not isinstance(left, np.ndarray) or left.shape != wanted or left.dtype != np.uint8:
        raise InvalidArgument("left", f"must be uint8 {wanted}", getattr(left, "shape", type(left).__name__))
    return left
