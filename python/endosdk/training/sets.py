"""Several data sets as one, and which of their pairs a run learns from."""

from __future__ import annotations

import hashlib
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import require_pairs
from endosdk.training.config import TrainConfig


class JoinedReader(DatasetReader):
    """The pairs of several readers of one split, one set after the other."""

    def __init__(self, parts: Sequence[DatasetReader]) -> None:
        """Join readers; none of them is changed."""
        self.parts = list(parts)
        self.split = self.parts[0].split
        self.name = " + ".join(part.name for part in self.parts)
        self.ids = tuple(f"{part.name}/{name}" for part in self.parts for name in part.ids)
        self._ends = list(accumulate(len(part) for part in self.parts))

    def __getitem__(self, index: int) -> Sample:
        part = bisect_right(self._ends, index)
        return self.parts[part][index - (self._ends[part - 1] if part else 0)]

    @property
    def sha256(self) -> str:
        """Hash of the hashes of all sets, in their order."""
        return hashlib.sha256("\n".join(part.sha256 for part in self.parts).encode()).hexdigest()


def open_sets(roots: Sequence[str], split: str, layout: str) -> DatasetReader:
    """Open one split of one or several sets of the same layout. Raises InvalidArgument when none is named."""
    if not roots:
        raise InvalidArgument("data", "must name the folder of a data set", "nothing")
    readers = [open_dataset(Path(root), split, layout=layout) for root in roots]
    for reader in readers:
        require_pairs(reader)
    return readers[0] if len(readers) == 1 else JoinedReader(readers)


def split_pairs(reader: DatasetReader, config: TrainConfig) -> tuple[list[int], list[int]]:
    """Return the indices trained on and those held out: of every set the last ones of its split.

    Raises InvalidArgument when there are not as many as the settings ask for.
    """
    parts = reader.parts if isinstance(reader, JoinedReader) else [reader]
    learned: list[int] = []
    held_out: list[int] = []
    first = 0
    for part in parts:
        border = len(part) - config.held_out
        if border < 1:
            rule = f"must leave some of the {len(part)} pairs of {part.name} to train on"
            raise InvalidArgument("held_out", rule, config.held_out)
        learned += range(first, first + border)
        held_out += range(first + border, first + len(part))
        first += len(part)
    wanted = len(learned) if config.train_pairs is None else config.train_pairs
    if wanted > len(learned):
        raise InvalidArgument("train_pairs", f"must be at most {len(learned)}: the pairs that are not held out", wanted)
    return learned[:wanted], held_out
