"""Depth of every frame of a source, each result beside the frame it came from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from endosdk.errors import CalibrationSizeMismatch
from endosdk.live.frames import Frame
from endosdk.live.sources.views import ways_to_split
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.result import DepthResult


def answers(
    estimator: DepthEstimator, frames: Iterable[Frame], *, reuse: bool = False, temporal: bool = False
) -> Iterator[tuple[Frame, DepthResult]]:
    """Yield (frame, result) for every frame, in order, as `DepthEstimator.stream` computes them.

    The frame carries number, time stamp, tag and both views. ``reuse`` and ``temporal`` are those of
    `stream`. Raises what `stream` does; where the rig is of another size, the error names the layouts that fit it.
    """
    pictures: list[tuple[int, int] | None] = []

    def watched() -> Iterator[Frame]:
        for frame in frames:
            if not pictures:
                pictures.append(frame.picture)
            yield frame

    try:
        for result in estimator.stream(watched(), reuse=reuse, temporal=temporal):
            yield result.source_frame, result
    except CalibrationSizeMismatch as error:
        rig = estimator.calibration
        if rig is None or not pictures or pictures[0] is None:
            raise
        ways = ways_to_split(pictures[0], (rig.width, rig.height))
        if not ways:
            raise
        rule = f"{error.rule}; try {' or '.join(ways)}"
        raise CalibrationSizeMismatch(error.argument, rule, error.value) from error
