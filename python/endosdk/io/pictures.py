"""Read frames from picture files and write the maps of a result as pictures other programs can read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.io.overview import overview
from endosdk.io.point_cloud import write_ply
from endosdk.runtime.result import DepthResult


def read_frame(path: str | Path) -> npt.NDArray[np.uint8]:
    """Read a picture file as RGB uint8 [H, W, 3]."""
    import cv2

    path = Path(path)
    if not path.is_file():
        raise InvalidArgument("frame", "must be a picture file", repr(str(path)))
    # As deep as it is stored: OpenCV would otherwise cut 16 bits down to 8, and with them most of a 12-bit camera's.
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if picture is None:
        raise InvalidArgument("frame", "must be a picture that OpenCV can read", repr(str(path)))
    if picture.dtype != np.uint8:
        raise InvalidArgument("frame", "must have 8 bits per channel", f"{picture.dtype} in {str(path)!r}")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def write_picture(path: Path, picture: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> None:
    """Write an RGB or single-channel picture, 8 or 16 bit; the name's ending chooses the format."""
    import cv2

    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if picture.ndim == 3 else picture
    if not cv2.imwrite(str(path), bgr):
        raise StorageFailed("out", "the picture must be writable (folder, space, ending)", str(path))


def write_result(folder: str | Path, left: npt.NDArray[np.uint8], result: DepthResult) -> dict[str, Path]:
    """Write what `write_maps` does, a picture of it all and the points; return name and path of each file.

    ``overview.png`` shows the maps, ``points.ply`` holds the depth as coloured points. ``left`` is the rectified left
    view, RGB uint8 [H, W, 3] like the maps.
    """
    written = write_maps(folder, result)
    written["overview.png"] = Path(folder) / "overview.png"
    write_picture(written["overview.png"], overview(left, result))
    if result.depth_map is not None:
        written["points.ply"] = Path(folder) / "points.ply"
        write_ply(written["points.ply"], result.points(), left)
    return written


def write_maps(folder: str | Path, result: DepthResult) -> dict[str, Path]:
    """Write the maps of one result into ``folder`` and return name and path of each file.

    ``disparity.png`` is 16-bit, px times 256; ``depth.png`` 16-bit whole millimetres; both 0 where there is no value.
    ``depth.npy`` keeps the float32 millimetres. ``confidence.png`` is 8-bit, times 255; ``reasons.png`` holds the bits.
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
        pictures["depth.png"] = _to_uint16(result.depth_map)
    written = {}
    for name, picture in pictures.items():
        write_picture(folder / name, picture)
        written[name] = folder / name
    if result.depth_map is not None:
        written["depth.npy"] = folder / "depth.npy"
        try:
            np.save(written["depth.npy"], result.depth_map)
        except OSError as error:
            raise StorageFailed("out", "must be writable", error) from error
    return written


def _to_uint16(values: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    # 65535 is kept free for values that do not fit, so that a far point is never read as a near one.
    return np.clip(np.rint(np.nan_to_num(values, nan=0.0, posinf=65535)), 0, 65535).astype(np.uint16)
