"""Several data sets as one, and which of their pairs a run learns from."""

from __future__ import annotations

import hashlib
import logging
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np

from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import layout_of, open_dataset
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import require_pairs
from endosdk.training.config import TrainConfig


class JoinedReader(DatasetReader):
    """The pairs of several readers of one split, one set after the other."""

    def __init__(self, parts: Sequence[DatasetReader]) -> None:
        """Join readers; none of them is changed."""
        self.parts = list(parts)
        self.split = " + ".join(dict.fromkeys(part.split for part in self.parts))
        self.name = " + ".join(part.name for part in self.parts)
        self.ids = tuple(f"{part.name}/{name}" for part in self.parts for name in part.ids)
        self._ends = list(accumulate(len(part) for part in self.parts))

    def __getitem__(self, index: int) -> Sample:
        part, within = self._place(index)
        return part[within]

    def film(self, index: int) -> str:
        """Name the film of which a pair is a frame."""
        part, within = self._place(index)
        return f"{part.name}/{part.film(within)}"

    def _place(self, index: int) -> tuple[DatasetReader, int]:
        part = bisect_right(self._ends, index)
        return self.parts[part], index - (self._ends[part - 1] if part else 0)

    @property
    def sha256(self) -> str:
        """Hash of the hashes of all sets, in their order."""
        return _hash_of([part.sha256 for part in self.parts])

    @property
    def split_sha256(self) -> str:
        """Hash of the hashes of all splits, in their order."""
        return _hash_of([part.split_sha256 for part in self.parts])


class HeldOutReader(DatasetReader):
    """Those pairs of a reader that a run held out of its training."""

    split = "held out"

    def __init__(self, whole: DatasetReader, indices: Sequence[int]) -> None:
        """Take these pairs of a reader, which is not changed."""
        self.whole, self.indices, self.name = whole, list(indices), whole.name
        self.ids = tuple(whole.ids[index] for index in self.indices)

    def __getitem__(self, index: int) -> Sample:
        return self.whole[self.indices[index]]

    def film(self, index: int) -> str:
        """Name the film of which a pair is a frame."""
        return self.whole.film(self.indices[index])

    @property
    def sha256(self) -> str:
        """Hash of the whole from which the pairs were taken."""
        return self.whole.sha256

    @property
    def split_sha256(self) -> str:
        """Hash of the split from which the pairs were taken, and of their ids."""
        return _hash_of([self.whole.split_sha256, *self.ids])


def _hash_of(lines: Sequence[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode(errors="surrogateescape")).hexdigest()


def open_sets(roots: Sequence[str], split: str, layout: str) -> DatasetReader:
    """Open one split of one or several sets: those with a ``dataset.json`` are ours, the others have this layout.

    Raises InvalidArgument when none is named.
    """
    if not roots:
        raise InvalidArgument("data", "must name the folder of a data set", "nothing")
    readers = [open_dataset(Path(root), split, layout=layout_of(root, layout)) for root in roots]
    for reader in readers:
        require_pairs(reader)
    return readers[0] if len(readers) == 1 else JoinedReader(readers)


def _film_start(part: DatasetReader, border: int) -> int:
    """Return the first pair that may not be trained on when as many are held out as there are from ``border`` on."""
    starts = [index for index in range(1, len(part)) if part.film(index) != part.film(index - 1)]
    if border == len(part) or border in starts:
        return border
    if not starts:
        logging.getLogger("endosdk").warning(
            "%s is one film: the pairs held out resemble those trained on, and their error is too good", part.name
        )
        return border
    return max((start for start in starts if start <= border), default=starts[0])


def split_pairs(reader: DatasetReader, config: TrainConfig) -> tuple[list[int], list[int]]:
    """Return the indices trained on and those held out: of every set the last ones of its split.

    The frames of a film resemble each other, so a film with pairs held out is not trained on at all: the pairs held
    out of a set of films are spread over its last films, and one film at least is trained on. A set that is one film
    is split all the same, with a warning in the log ``endosdk``. Raises InvalidArgument when there are not as many
    pairs as the settings ask for.
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
        start = _film_start(part, border)
        count = min(config.held_out, len(part) - start)
        learned += range(first, first + start)
        held_out += [first + round(index) for index in np.linspace(start, len(part) - 1, count)]
        first += len(part)
    wanted = len(learned) if config.train_pairs is None else config.train_pairs
    if wanted > len(learned):
        raise InvalidArgument("train_pairs", f"must be at most {len(learned)}: the pairs that are not held out", wanted)
    return learned[:wanted], held_out
