"""What is left of a picture that was stored as JPEG."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def as_jpeg(picture: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    """Return an RGB picture [H, W, 3] as it comes out of a JPEG of this quality, 0 to 100."""
    import cv2

    # OpenCV takes BGR. JPEG keeps more of red than of blue.
    _, packed = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.ascontiguousarray(np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)[..., ::-1])
