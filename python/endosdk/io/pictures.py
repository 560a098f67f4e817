"""Read frames from picture files, and write pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import Refused
from endosdk.io.picture_bytes import read_picture
from endosdk.io.whole_files import whole_file


def read_frame(path: str | Path) -> npt.NDArray[np.uint8]:
    """Read a picture file as RGB uint8 [H, W, 3]. Raises InvalidArgument where it is damaged, cut off or none."""
    import cv2

    path = Path(path)
    try:
        # As deep as it is stored: OpenCV would otherwise cut 16 bits to 8, and with them most of a 12-bit camera's.
        picture = read_picture(path, "IMREAD_COLOR|IMREAD_ANYDEPTH")
    except Refused as error:
        raise InvalidArgument("frame", error.rule, f"{error.value}: {str(path)!r}") from error
    if picture.dtype != np.uint8:
        raise InvalidArgument("frame", "must have 8 bits per channel", f"{picture.dtype} in {str(path)!r}")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def write_picture(path: Path, picture: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> None:
    """Write an RGB or single-channel picture, 8 or 16 bit, whole or not at all; the name's ending is the format."""
    import cv2

    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if picture.ndim == 3 else picture
    try:
        done, data = cv2.imencode(path.suffix, bgr)
    except cv2.error as error:
        raise InvalidArgument("out", "must have the ending of a picture", repr(path.suffix)) from error
    if not done:
        raise InvalidArgument("out", "must be a picture that this format can hold", f"{picture.dtype} {picture.shape}")
    with whole_file(path, "out") as stream:
        stream.write(data.tobytes())
