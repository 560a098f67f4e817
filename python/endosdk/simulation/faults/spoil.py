"""Draw the faults of one pair, and spoil it with them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from endosdk.datasets.dataset import Sample
from endosdk.simulation.faults.chips import (
    Chip,
    Processor,
    add_noise,
    dimming,
    draw_chips,
    draw_processor,
    process,
    take,
)

CLEAN_SHARE = 0.1  # of the pairs have no faults at all


@dataclass(frozen=True)
class Faults:
    """All that spoils one pair."""

    chips: tuple[Chip, Chip]
    processor: Processor

    def described(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return asdict(self)


def draw_faults(seed: tuple[int, ...]) -> Faults | None:
    """Draw the faults of a pair; None leaves it clean. The same seed gives the same."""
    rng = np.random.default_rng(seed)
    if rng.random() < CLEAN_SHARE:
        return None
    return Faults(draw_chips(rng), draw_processor(rng))


def spoil(sample: Sample, faults: Faults, seed: tuple[int, ...]) -> Sample:
    """Return the pair with its faults, recorded in ``info``; a function of its arguments alone."""
    left, right = (view.astype(np.float32) for view in (sample.left, sample.right))
    factor = dimming(left, faults.processor.level)
    views = []
    for side, (view, chip) in enumerate(zip((left, right), faults.chips, strict=True)):
        noisy = add_noise(take(view, chip, factor), chip, np.random.default_rng((*seed, side)))
        views.append(process(noisy, faults.processor))
    return replace(sample, left=views[0], right=views[1], info={**sample.info, "faults": faults.described()})
