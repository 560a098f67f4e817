"""Depth of every frame of a source, each result beside the frame it came from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from endosdk.live.frames import Frame
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.result import DepthResult


def answers(
    estimator: DepthEstimator, frames: Iterable[Frame], *, reuse: bool = False, temporal: bool = False
) -> Iterator[tuple[Frame, DepthResult]]:
    """Yield (frame, result) for every frame, in order, as `DepthEstimator.stream` computes them.

    The frame carries number, time stamp, tag and both views. ``reuse`` and ``temporal`` are those of
    `stream`.
    """
    for result in estimator.stream(frames, reuse=reuse, temporal=temporal):
        yield result.source_frame, result
