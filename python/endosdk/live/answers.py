"""Depth of every frame of a source, each result beside the frame it came from."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

from endosdk.live.frames import Frame, Picture
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.result import DepthResult


def answers(
    estimator: DepthEstimator, frames: Iterable[Frame], *, reuse: bool = False, temporal: bool = False
) -> Iterator[tuple[Frame, DepthResult]]:
    """Yield (frame, result) for every frame, in order, as `DepthEstimator.stream` computes them.

    The frame carries number, time stamp, tag and both views. ``reuse`` and ``temporal`` are those of
    `stream`.
    """
    drawn: deque[Frame] = deque()

    def pairs() -> Iterator[tuple[Picture, Picture]]:
        for frame in frames:
            drawn.append(frame)
            yield frame.left, frame.right

    for result in estimator.stream(pairs(), reuse=reuse, temporal=temporal):
        yield drawn.popleft(), result
