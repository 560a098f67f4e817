"""Small videos of known pictures, written with PyAV as cameras and capture cards give them."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from tests.conftest import textured_picture

RATE = 25


def views(count: int, height: int = 48, width: int = 64) -> list[tuple[np.ndarray, np.ndarray]]:
    """Stereo frames of a plane that moves: every frame is another, the right view is the left one 6 px further."""
    gray = textured_picture(height, width + 6 + 2 * count, 3).mean(axis=2, keepdims=True)
    wide = (gray * (1.0, 0.75, 0.7)).astype(np.uint8)  # colours as smooth as tissue's: video stores few of them
    return [
        (
            np.ascontiguousarray(wide[:, 2 * n : 2 * n + width]),
            np.ascontiguousarray(wide[:, 2 * n + 6 : 2 * n + 6 + width]),
        )
        for n in range(count)
    ]


def side_by_side(pairs) -> list[np.ndarray]:
    return [np.hstack(pair) for pair in pairs]


def write(
    path: Path | str,
    pictures,
    codec="ffv1",
    pixels="bgr0",
    interlaced=False,
    stamps=None,
    container=None,
    options=None,
) -> Path:
    """Write RGB pictures as a video; ``stamps`` are in frames."""
    with av.open(path if hasattr(path, "write") else str(path), "w", format=container) as file:
        stream = file.add_stream(codec, rate=RATE, options=options or {})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pixels
        if interlaced:
            stream.codec_context.flags |= av.codec.context.Flags.interlaced_dct
        stream.codec_context.time_base = Fraction(1, RATE)
        for number, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame.pts = number if stamps is None else stamps[number]
            frame.time_base = Fraction(1, RATE)
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    return path
