"""Write the maps of a result as files that other programs can read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.errors import StorageFailed
from endosdk.io.pictures import write_picture
from endosdk.io.point_cloud import write_ply
from endosdk.io.whole_files import whole_file
from endosdk.runtime.overview import colour_map, overview, robust_range
from endosdk.runtime.result import DepthResult

# What a result without a rig has not.
METRIC_FILES = ("depth.png", "depth.npy", "sigma.npy", "depth_preview.png", "points.ply")

DEPTH_STEPS_PER_MM = 10  # of depth.png: up to 6.5 m in steps far below any error


def write_result(
    folder: str | Path,
    left: npt.NDArray[np.uint8],
    result: DepthResult,
    truth: npt.NDArray[np.floating] | None = None,
) -> dict[str, Path]:
    """Write what `write_maps` does, a picture of it all and the points; return name and path of each file.

    ``overview.png`` shows the maps, ``depth_preview.png`` the depth in colours, since ``depth.png`` looks black to most
    viewers; ``points.ply`` holds the depth as coloured points. ``left`` is the rectified left
    view, RGB uint8 [H, W, 3] like the maps. With ``truth``, the true disparity, the picture shows the error too.
    Files of an earlier result go, so that a folder never holds maps of two.
    """
    written = write_maps(folder, result)
    written["overview.png"] = Path(folder) / "overview.png"
    write_picture(written["overview.png"], overview(left, result, truth))
    if result.depth_map is not None:
        written["depth_preview.png"] = Path(folder) / "depth_preview.png"
        write_picture(written["depth_preview.png"], colour_map(result.depth_map, *robust_range(result.depth_map)))
        written["points.ply"] = Path(folder) / "points.ply"
        write_ply(written["points.ply"], result.points(), left)
    for name in METRIC_FILES:
        if name not in written:
            (Path(folder) / name).unlink(missing_ok=True)
    return written


def write_maps(folder: str | Path, result: DepthResult) -> dict[str, Path]:
    """Write the maps of one result into ``folder`` and return name and path of each file.

    ``disparity.png`` is 16-bit, px times 256; ``depth.png`` 16-bit, tenths of a mm; both 0 where there is no value.
    ``depth.npy`` keeps the float32 millimetres, ``sigma.npy`` the expected error of each, float32 mm; both NaN where
    there is no value. ``confidence.png`` is 8-bit, times 255; ``reasons.png`` holds the bits. Files of depth and sigma
    need a calibration.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed("out", "the folder must be writable", error) from error
    pictures: dict[str, npt.NDArray[np.uint8] | npt.NDArray[np.uint16]] = {
        "disparity.png": _to_uint16(result.disparity * 256),
        "confidence.png": np.rint(result.confidence * 255).astype(np.uint8),
        "reasons.png": result.reasons,
    }
    if result.depth_map is not None:
        pictures["depth.png"] = _to_uint16(result.depth_map * DEPTH_STEPS_PER_MM)
    written = {}
    for name, picture in pictures.items():
        write_picture(folder / name, picture)
        written[name] = folder / name
    for name, values in (("depth.npy", result.depth_map), ("sigma.npy", result.sigma_map)):
        if values is not None:
            written[name] = folder / name
            with whole_file(written[name], "out") as stream:
                np.save(stream, values)
    return written


def _to_uint16(values: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    # 65535 is kept free for values that do not fit, so that a far point is never read as a near one.
    return np.clip(np.rint(np.nan_to_num(values, nan=0.0, posinf=65535)), 0, 65535).astype(np.uint16)
