"""Where a left view is hard to match: glare, low texture, and the edges of instruments.

Lengths are px of a frame 960 px wide and grow with the width. Views are uint8 [H, W, 3] RGB; masks are bool [H, W].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.evaluation.edges import WIDTH, edge_ends, within_band
from endosdk.evaluation.metrics import Map, Mask

Picture = npt.NDArray[np.uint8]

BLOWN_OUT = _core.saturation_level  # of all channels
HALO = 3.0  # px on each side of blown-out pixels: the flank of a highlight moves with the eye as its middle does
TEXTURE_WINDOW = 13  # px a side
NO_TEXTURE = 1.5  # grey levels: the standard deviation in the window, without what is finer than three pixels
COLOURLESS = 0.25  # the least and the largest channel differ by less than this share of the largest: metal, not tissue


def glare(view: Picture) -> Mask:
    """Return the pixels in or beside a highlight in which all channels are blown out."""
    import cv2

    blown_out = (view.min(axis=2) >= BLOWN_OUT).astype(np.uint8)
    return np.asarray(cv2.dilate(blown_out, _square(HALO, view)) > 0)


def low_texture(view: Picture) -> Mask:
    """Return the pixels around which the brightness is nearly the same; glare, which is flat too, is not among them."""
    import cv2

    grey = cv2.blur(cv2.cvtColor(view, cv2.COLOR_RGB2GRAY).astype(np.float32), (3, 3))
    side = _square((TEXTURE_WINDOW - 1) / 2, view).shape
    mean, square = cv2.blur(grey, side), cv2.blur(grey * grey, side)
    return np.asarray(square - mean * mean < NO_TEXTURE**2) & ~glare(view)


def instrument_edges(view: Picture, truth: Map) -> Mask:
    """Return the pixels near a depth edge whose nearer surface has no colour, as the metal of instruments.

    Only for pairs with instruments in them (`has_instruments`): elsewhere grey surfaces are something else.
    """
    import cv2

    colours = cv2.medianBlur(np.ascontiguousarray(view), 5).astype(np.int16)
    largest = colours.max(axis=2)
    metal = largest - colours.min(axis=2) <= COLOURLESS * np.maximum(largest, 1)
    return within_band(edge_ends(truth) & metal)


def has_instruments(info: Mapping[str, Any]) -> bool:
    """Tell from the record of a sample of ours whether an instrument is in the picture."""
    scene = info.get("scene")
    return bool(info.get("tools")) or (isinstance(scene, Mapping) and scene.get("instrument") is not None)


def _square(reach: float, view: Picture) -> npt.NDArray[np.uint8]:
    """Return ones over a square that reaches so many px to each side of its middle, one at least."""
    count = 2 * max(1, round(reach * view.shape[1] / WIDTH)) + 1
    return np.ones((count, count), np.uint8)
