"""Write the maps of a result, and what is said of it, as files that other programs can read."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.io.file_hash import file_sha256
from endosdk.io.new_folders import made_folder
from endosdk.io.pictures import DISPARITY_STEPS, LARGEST_DISPARITY, write_picture
from endosdk.io.point_cloud import write_ply
from endosdk.io.whole_files import whole_file, write_json
from endosdk.runtime.overview import colour_map, overview, robust_range
from endosdk.runtime.result import DepthResult

RESULT = "result.json"

# What a result without a rig has not. Its maps lie over the left picture as it came.
FILES_OF_A_RIG = ("left_rectified.png", "depth.png", "depth.npy", "sigma.npy", "depth_preview.png", "points.ply")

DISPARITY_ARRAY = "disparity.npy"

GEOMETRY = ("focal_px", "focal_y_px", "cx", "cy", "baseline_mm", "doffs")  # of a record, by the names of the rig's

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
    Files of an earlier result go, so that a folder never holds maps of two. That holds for its record, too:
    `write_record` writes that of this result. Raises `InvalidArgument` where ``left`` is no such picture, and
    `StorageFailed`.
    """
    folder = made_folder(Path(folder), "out")
    _remove(folder / RESULT)  # first: a record always stands beside the files that it names
    written = write_maps(folder, left, result)
    written["overview.png"] = folder / "overview.png"
    write_picture(written["overview.png"], overview(left, result, truth))
    if result.depth_map is not None:
        written["depth_preview.png"] = folder / "depth_preview.png"
        write_picture(written["depth_preview.png"], colour_map(result.depth_map, *robust_range(result.depth_map)))
        written["points.ply"] = folder / "points.ply"
        write_ply(written["points.ply"], result.points(), left)
    for name in (*FILES_OF_A_RIG, DISPARITY_ARRAY):
        if name not in written:
            _remove(folder / name)
    return written


def write_maps(folder: str | Path, left: npt.NDArray[np.uint8], result: DepthResult) -> dict[str, Path]:
    """Write the maps of one result into ``folder`` and return name and path of each file.

    ``disparity.png`` is 16-bit, px times 256; ``depth.png`` 16-bit, tenths of a mm; both 0 where there is no value.
    A disparity of 256 px or more, or below 1/512 px, does not fit into that picture: where there is one (principal
    points apart give negative ones), ``disparity.npy`` has all of them,
    float32 px, NaN where there is no value, and a warning goes to the log ``endosdk``.
    ``depth.npy`` keeps the float32 millimetres, ``sigma.npy`` the expected error of each, float32 mm; both NaN where
    there is no value. ``confidence.png`` is 8-bit, times 255; ``reasons.png`` holds the bits. With a calibration,
    ``left_rectified.png`` is ``left``, the rectified left view, RGB uint8 [H, W, 3], over which all maps lie; without
    one nothing was rectified, and there is no such file and none in mm. Raises `InvalidArgument` where ``left`` has
    another size than the maps, and `StorageFailed`.
    """
    if left.dtype != np.uint8 or left.shape != (*result.disparity.shape, 3):
        raise InvalidArgument(
            "left", f"must be uint8 {(*result.disparity.shape, 3)}, as the maps", f"{left.dtype} {left.shape}"
        )
    folder = made_folder(Path(folder), "out")
    disparity = np.where(result.reasons == 0, result.disparity, np.float32(np.nan))
    pictures: dict[str, npt.NDArray[np.uint8] | npt.NDArray[np.uint16]] = {
        "disparity.png": _to_uint16(disparity * np.float32(DISPARITY_STEPS)),
        "confidence.png": np.rint(result.confidence * 255).astype(np.uint8),
        "reasons.png": result.reasons,
    }
    if result.depth_map is not None:
        pictures["left_rectified.png"] = left
        pictures["depth.png"] = _to_uint16(result.depth_map * DEPTH_STEPS_PER_MM)
    written = {}
    for name, picture in pictures.items():
        write_picture(folder / name, picture)
        written[name] = folder / name
    arrays = {"depth.npy": result.depth_map, "sigma.npy": result.sigma_map, DISPARITY_ARRAY: _beyond_picture(disparity)}
    for name, values in arrays.items():
        if values is not None:
            written[name] = folder / name
            with whole_file(written[name], "out") as stream:
                np.save(stream, values)
    return written


def _beyond_picture(disparity: npt.NDArray[np.float32]) -> npt.NDArray[np.float32] | None:
    """Return the map where disparity.png cannot hold all of it."""
    lost = int(((disparity > LARGEST_DISPARITY) | (disparity < 0.5 / DISPARITY_STEPS)).sum())
    if lost == 0:
        return None
    logging.getLogger("endosdk").warning(
        "disparity.png cannot hold the %d disparities over %.0f px or below 0, and says 0 there; %s has them all",
        *(lost, LARGEST_DISPARITY, DISPARITY_ARRAY),
    )
    return disparity


def write_record(
    folder: str | Path, result: DepthResult, files: Mapping[str, Path], pictures: tuple[Path, Path]
) -> Path:
    """Write ``result.json``: what `described` says, and name and SHA-256 of both pictures and of each of ``files``.

    Returns its path. Raises `StorageFailed`.
    """
    left, right = pictures
    record = {
        "left": left.name,
        "right": right.name,
        "inputs_sha256": {"left": file_sha256(left), "right": file_sha256(right)},
        **described(result),
        "files": {name: file_sha256(path) for name, path in files.items()},
    }
    write_json(Path(folder) / RESULT, record, "out")
    return Path(folder) / RESULT


def described(result: DepthResult) -> dict[str, Any]:
    """Return what a result is, beside its maps, as JSON values; it is the same on every machine.

    ``causes`` has the measure of each cause. Medians are of the valid pixels, None without any. ``size`` is (width,
    height) of the maps, px. ``geometry`` turns a pixel of the maps into a point, as `DepthResult.points` does; None
    without a calibration.
    """
    height, width = result.disparity.shape
    valid = result.reasons == 0
    return {
        "status": result.status.name,
        "causes": {cause.name: measure for cause, measure in result.causes.items()},
        "valid_share": round(result.valid_share, 4),
        "median_disparity_px": _median(result.disparity[valid]),
        "median_depth_mm": None if result.depth_map is None else _median(result.depth_map[valid]),
        "size": [width, height],
        "geometry": None if result.geometry is None else {name: getattr(result.geometry, name) for name in GEOMETRY},
        "model": result.model.identity(),
        "calibration_sha256": result.calibration_sha256,
        "provider": result.identity.provider,
    }


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise StorageFailed("out", "files of an earlier result must be removable", error) from error


def _median(values: npt.NDArray[np.float32]) -> float | None:
    return round(float(np.median(values)), 3) if values.size else None


def _to_uint16(values: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    # 0 is no value. What does not fit has none: clamped, a far point would be read as a near one.
    steps = np.rint(np.nan_to_num(values, nan=0.0, posinf=0.0))
    return np.where(steps <= 65535, np.maximum(steps, 0), 0).astype(np.uint16)
