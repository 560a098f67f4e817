"""From one decoded picture to two views: which half is which eye, and what is stretched again."""

from __future__ import annotations

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.live.frames import Picture
from endosdk.live.sources.source import Layout


def split(picture: Picture, layout: Layout) -> tuple[Picture, Picture]:
    """Return the left and the right view, RGB uint8 [H, W, 3]; the left one is left, or on top.

    Raises InvalidArgument where the picture cannot be halved.
    """
    across = layout.startswith("side-by-side")
    side = picture.shape[1 if across else 0]
    if side % 2:
        name = "width" if across else "height"
        raise InvalidArgument("source", f"{layout} video must have an even {name}, half of it for each view", side)
    half = side // 2
    if across:
        left, right = picture[:, :half], picture[:, half:]
    else:
        left, right = picture[:half], picture[half:]
    if layout.endswith("-half"):
        return _stretched(left, across), _stretched(right, across)
    return np.ascontiguousarray(left), np.ascontiguousarray(right)


def _stretched(view: Picture, across: bool) -> Picture:
    """Undo the squeeze of a view, with pixel centres as everywhere here."""
    import cv2

    height, width = view.shape[:2]
    size = (2 * width, height) if across else (width, 2 * height)
    return np.asarray(cv2.resize(view, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
