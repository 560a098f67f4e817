"""One stereo frame of a source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Frame:
    """Two views taken at the same time: RGB uint8 [H, W, 3] each.

    ``number`` counts the frames of the source from 0, those that were dropped included. ``stamp_ns`` never runs
    backwards; `Source.clock` says what it counts from. ``tag`` is whatever the user attached. ``fault`` says what was
    wrong with this frame, None where nothing was. ``monotonic_ns`` is when it was taken by the clock of
    ``time.monotonic_ns()``; None where the source is not live: its age would say nothing. ``picture`` is the size,
    (width, height) in px, of the picture that held both views; None where each came by itself.
    """

    left: Picture
    right: Picture
    number: int
    stamp_ns: int
    tag: Any = None
    fault: str | None = None
    monotonic_ns: int | None = None
    picture: tuple[int, int] | None = None
