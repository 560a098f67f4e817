"""From one decoded picture to two views: which half is which eye, and what is stretched again."""

from __future__ import annotations

from typing import get_args

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.live.frames import Picture
from endosdk.live.sources.source import Layout


def split(picture: Picture, layout: Layout, gap: int = 0) -> tuple[Picture, Picture]:
    """Return the left and the right view, RGB uint8 [H, W, 3]; the left one is left, on top, or has the even rows.

    ``gap`` is how many columns or rows lie between the views, px. Raises InvalidArgument where the picture cannot be
    halved.
    """
    across = layout.startswith("side-by-side")
    side = picture.shape[1 if across else 0]
    half = (side - gap) // 2
    if half < 1 or side != 2 * half + gap:
        name = "width" if across else "height"
        beside = f" beside the gap of {gap} px" if gap else ""
        raise InvalidArgument(
            "source", f"{layout} video must have an even {name}{beside}, half of it for each view", side
        )
    if across:
        left, right = picture[:, :half], picture[:, half + gap :]
    elif layout.startswith("top-bottom"):
        left, right = picture[:half], picture[half + gap :]
    else:
        left, right = picture[0::2], picture[1::2]
    if layout.endswith("-half"):
        return _stretched(left, across), _stretched(right, across)
    return np.ascontiguousarray(left), np.ascontiguousarray(right)


def ways_to_split(picture: tuple[int, int], view: tuple[int, int]) -> list[str]:
    """Return the options, as those of the command line, by which a picture holds two views; sizes are (width, height).

    A gap is smaller than a view: a larger picture holds something else.
    """
    ways = []
    for layout in get_args(Layout):
        along, other = (0, 1) if layout.startswith("side-by-side") else (1, 0)
        held = (view[along] + 1) // 2 if layout.endswith("-half") else view[along]
        gap = picture[along] - 2 * held
        may_have_gap = layout in ("side-by-side", "top-bottom")
        if picture[other] == view[other] and (gap == 0 or (may_have_gap and 0 < gap < held)):
            ways.append(f"--layout {layout}" + (f" --gap {gap}" if gap else ""))
    return ways


def _stretched(view: Picture, across: bool) -> Picture:
    """Undo the squeeze of a view, with pixel centres as everywhere here."""
    import cv2

    height, width = view.shape[:2]
    size = (2 * width, height) if across else (width, 2 * height)
    return np.asarray(cv2.resize(view, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
