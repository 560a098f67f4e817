"""How much of the truth of training pairs no plane of a network reaches."""

from __future__ import annotations

import logging

from endosdk.errors import DatasetInvalid
from endosdk.training.data import Crops

LOG = logging.getLogger("endosdk")
COUNTED_PAIRS = 64  # so many tell how much it is


def count_beyond_range(crops: Crops, pairs: list[int], max_disparity: int, name: str) -> float:
    """Return the share of the truth, in ``pairs`` spread over those of a set, from ``max_disparity`` px on, and warn.

    Raises DatasetInvalid, with the ``name`` of the set, where no pair has any that is reached.
    """
    seen = pairs[:: -(-len(pairs) // COUNTED_PAIRS)]
    known, beyond = (sum(counts) for counts in zip(*(_counts(crops, i, max_disparity) for i in seen), strict=True))
    if known == beyond and all(k == b for k, b in (_counts(crops, i, max_disparity) for i in pairs)):
        rule = f"must have truth below max_disparity, {max_disparity} px, in the pairs trained on"
        raise DatasetInvalid("dataset", rule, f"none in {name}")
    if beyond:
        message = "%.1f %% of the truth in %d training pairs lies beyond max_disparity, %d px, and is not learned from"
        LOG.warning(message, 100 * beyond / known, len(seen), max_disparity)
    return beyond / known if known else 0.0


def _counts(crops: Crops, index: int, max_disparity: int) -> tuple[int, int]:
    """Count the pixels of a pair that have truth, and those of them that no plane reaches."""
    truth, too_large = crops.truth(index), crops.too_large(index)
    return int((truth > 0).sum()) + too_large, int((truth >= max_disparity).sum()) + too_large
