"""What the readers of public data sets share: a list of samples found on disk, a hash over their files, and checks."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.dataset import SPLITS, DatasetReader, Sample
from endosdk.errors import DatasetInvalid, InvalidArgument
from endosdk.io.file_hash import files_sha256


class PublicReader(DatasetReader):
    """One split of a set that others published; nothing is written beside their files.

    A sub-class says which splits have truth, finds the samples, and reads one.
    """

    layout: ClassVar[str]
    splits: ClassVar[tuple[str, ...]]  # those with published truth
    default_split: ClassVar[str]
    pattern: ClassVar[str]  # of the files by which samples are found, below the root

    def __init__(self, root: Path, split: str) -> None:
        """Find the samples of the split. Raises DatasetInvalid when there is none."""
        if split not in SPLITS:
            raise InvalidArgument("split", f"must be one of {', '.join(SPLITS)}", split)
        if split not in self.splits:
            rule = f"must be {' or '.join(self.splits)}: the layout {self.layout} has truth for no other"
            raise InvalidArgument("split", rule, split)
        self.root, self.split, self.name = root, split, f"{self.layout}:{root.resolve().name}"
        if not root.is_dir():
            raise DatasetInvalid("dataset", "must be a folder that is there", root)
        self._files = self.find()
        if not self._files:
            rule = f"must hold samples in the layout {self.layout}, split {split}: {self.pattern}"
            raise DatasetInvalid("dataset", rule, f"none in {root}")
        self.ids = tuple(sorted(self._files))

    @abstractmethod
    def find(self) -> dict[str, tuple[Path, ...]]:
        """Return the files of each sample by its id, in the order in which `read` takes them."""

    @abstractmethod
    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read one sample. Raises DatasetInvalid naming the file that is missing or wrong."""

    def __getitem__(self, index: int) -> Sample:
        """Read sample ``index``."""
        sample_id = self.ids[index]
        sample = self.read(sample_id, self._files[sample_id])
        shape = sample.left.shape[:2]
        for name, found in (("right view", sample.right.shape[:2]), ("truth", sample.disparity.shape)):
            if found != shape:
                raise DatasetInvalid("sample", f"{sample_id}: the {name} must be as large as the left {shape}", found)
        return sample

    @cached_property
    def sha256(self) -> str:
        """Hash over the names and contents of the files of this split (the whole of it is read)."""
        paths = {path for files in self._files.values() for path in files if path.exists()}
        try:
            return files_sha256((str(path.relative_to(self.root)), path) for path in sorted(paths))
        except OSError as error:
            raise DatasetInvalid(
                "dataset", "must hold files that can be read", f"{error.filename} ({error.strerror})"
            ) from error

    @property
    def split_sha256(self) -> str:
        """Return `sha256`, which covers this split alone."""
        return self.sha256


def require_size(path: Path, found: NDArray[Any], truth: NDArray[np.float32]) -> None:
    """Raise DatasetInvalid unless what a file holds is as large as the truth."""
    if found.shape[:2] != truth.shape:
        raise DatasetInvalid("sample", f"{path} must be as large as the truth {truth.shape}", found.shape[:2])


def positive(path: Path, name: str, value: float) -> float:
    """Return a number of a calibration. Raises DatasetInvalid unless it is finite and above 0."""
    if not 0 < value < math.inf:
        raise DatasetInvalid("sample", f"the {name} of {path} must be finite and above 0", value)
    return value


def finite(path: Path, name: str, value: float) -> float:
    """Return a number of a calibration. Raises DatasetInvalid unless it is finite."""
    if not math.isfinite(value):
        raise DatasetInvalid("sample", f"the {name} of {path} must be finite", value)
    return value
