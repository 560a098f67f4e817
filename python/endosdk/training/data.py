"""Training crops out of a data set on disk."""

from __future__ import annotations

import multiprocessing
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, default_collate

from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import EndoError, InvalidArgument
from endosdk.io.pictures import DISPARITY_STEPS
from endosdk.io.progress import progress
from endosdk.training.augment import Pair, mirror, plain_pair, random_pair
from endosdk.training.frame_size import seen_size, seen_truth, seen_views

LARGEST_PACKED = int(np.iinfo(np.uint16).max)


@dataclass(frozen=True)
class _Stored:
    """One decoded pair as it waits in memory: 5 bytes a pixel and view; disparities in steps as on disk."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity: NDArray[np.uint16]
    disparity_right: NDArray[np.uint16] | None
    too_large: int  # pixels of the left truth that 16 bits cannot hold: unknown here

    @property
    def size(self) -> int:
        right = 0 if self.disparity_right is None else self.disparity_right.nbytes
        return self.left.nbytes + self.right.nbytes + self.disparity.nbytes + right


class Crops(Dataset[tuple[Tensor, ...]]):
    """An endless list of training crops; item i is a function of the seed and i alone.

    Each epoch visits every pair once, in an order of its own. Because nothing is remembered between items, a run that
    is resumed, or spread over processes, sees the same crops as one that was never stopped. Items are (left, right,
    disparity): uint8 [3, h, w] twice and float32 [1, h, w] in px, NaN where there is no truth.
    """

    def __init__(
        self,
        reader: DatasetReader,
        indices: Sequence[int],
        crop: tuple[int, int],
        *,
        seed: int,
        augment: bool = True,
        looks: Collection[str] = (),
        cache_gib: float = 8.0,
        inference_width: int | None = None,
    ) -> None:
        """Read the given samples of ``reader``, as seen at ``inference_width``; memory keeps up to ``cache_gib``.

        Raises InvalidArgument when there is none, or when the first is smaller than ``crop``.
        """
        if not indices:
            raise InvalidArgument("data", "must hold at least one training pair", "none")
        self.reader = reader
        self.indices = list(indices)
        self.crop = crop
        self.seed = seed
        self.augment = augment
        self.looks = frozenset(looks)
        self.inference_width = inference_width
        self._cache: dict[int, _Stored] = {}
        self._room = int(cache_gib * 2**30)
        self._check_size(self._load(self.indices[0]))

    def __getitem__(self, item: int) -> tuple[Tensor, ...]:
        """Draw crop ``item`` >= 0."""
        pair, mirrored, rng = self._drawn(item)
        if self.augment:
            return as_tensors(random_pair(pair, mirrored, self.crop, rng, self.looks))
        return as_tensors(plain_pair(pair, self.crop, rng))

    def _drawn(self, item: int) -> tuple[Pair, Pair | None, np.random.Generator]:
        """Return the whole pair of crop ``item``, what a mirror shows of it, and what draws the rest."""
        epoch, position = divmod(item, len(self.indices))
        order = np.random.default_rng([self.seed, 0, epoch]).permutation(len(self.indices))
        stored = self._load(self.indices[int(order[position])])
        self._check_size(stored)
        mirrored = None
        if self.augment and stored.disparity_right is not None:
            mirrored = mirror(stored.left, stored.right, _truth(stored.disparity_right))
        rng = np.random.default_rng([self.seed, 1, item])
        return Pair(stored.left, stored.right, _truth(stored.disparity)), mirrored, rng

    def truth(self, index: int) -> NDArray[np.float32]:
        """Disparity [H, W] of a sample of the reader in px as the network sees it, NaN where there is none."""
        return _truth(self._load(index).disparity)

    def too_large(self, index: int) -> int:
        """Count the pixels of a sample whose disparity is too large to be kept; `truth` has none there."""
        return self._load(index).too_large

    def batches(
        self, batch: int, *, first: int, last: int, rank: int, world: int, workers: int
    ) -> Iterator[list[Tensor]]:
        """Yield the batches of steps ``first`` to ``last`` - 1 for one of ``world`` processes."""
        if workers and multiprocessing.get_start_method() == "fork":
            self._decode_ahead(workers)
        items = [(step * world + rank) * batch + slot for step in range(first, last) for slot in range(batch)]
        loader: DataLoader[Any] = DataLoader(
            _Told(self), batch_size=batch, sampler=items, num_workers=workers, collate_fn=_batch_or_error
        )
        for found in loader:
            if isinstance(found, EndoError):
                raise found
            yield found

    def _decode_ahead(self, threads: int) -> None:
        """Decode the pairs that fit into memory: forked processes then share them, instead of decoding each anew."""
        fitting = self.indices[: 1 + self._room // self._load(self.indices[0]).size]
        with ThreadPoolExecutor(threads) as pool, progress(total=len(fitting), title="decoding", stays=False) as bar:
            for _ in pool.map(self._load, fitting):
                bar.update()

    def _load(self, index: int) -> _Stored:
        if index in self._cache:
            return self._cache[index]
        sample = self.reader[index]
        size = seen_size(sample.left.shape[1], sample.left.shape[0], self.inference_width)
        left, right = (
            np.ascontiguousarray(view.transpose(1, 2, 0)) for view in seen_views(sample.left, sample.right, size)
        )
        truth = seen_truth(sample.disparity, size)
        truth_right = None if sample.disparity_right is None else _packed(seen_truth(sample.disparity_right, size))
        too_large = int((_scaled(truth) > LARGEST_PACKED).sum())
        stored = _Stored(left, right, _packed(truth), truth_right, too_large)
        if stored.size <= self._room:
            self._room -= stored.size
            self._cache[index] = stored
        return stored

    def _check_size(self, stored: _Stored) -> None:
        height, width = stored.left.shape[:2]
        if height < self.crop[0] or width < self.crop[1]:
            raise InvalidArgument(
                "crop", f"must fit into frames of {height} x {width}, as the network sees them", self.crop
            )


class _Told(Dataset[Any]):
    """Crops, or what is wrong with a sample: torch makes another error of one that a worker raises."""

    def __init__(self, crops: Crops) -> None:
        self._crops = crops

    def __getitem__(self, item: int) -> tuple[Tensor, ...] | EndoError:
        try:
            return self._crops[item]
        except EndoError as error:
            return error


def _batch_or_error(found: list[Any]) -> Any:
    """Return a batch, or the first error among its crops."""
    return next((one for one in found if isinstance(one, EndoError)), None) or default_collate(found)


def as_tensors(pair: Pair) -> tuple[Tensor, Tensor, Tensor]:
    """Turn a pair into what a network learns from."""
    return planar(pair.left), planar(pair.right), torch.from_numpy(np.ascontiguousarray(pair.disparity))[None]


def planar(view: NDArray[np.uint8]) -> Tensor:
    """Turn [H, W, 3] into a tensor [3, H, W]."""
    return torch.from_numpy(np.ascontiguousarray(view.transpose(2, 0, 1)))


def has_truth(disparity: Tensor, max_disparity: int) -> Tensor:
    """Mask of pixels that a network of this range can learn from: truth above 0 and below its maximum."""
    return (disparity > 0) & (disparity < max_disparity)


def _packed(disparity: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return the truth in 16 bits; 0 where there is none, or one that they cannot hold."""
    scaled = _scaled(disparity)
    return np.where((scaled > 0) & (scaled <= LARGEST_PACKED), scaled, 0).astype(np.uint16)


def _scaled(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.rint(disparity * np.float32(DISPARITY_STEPS)), dtype=np.float32)


def _truth(packed: NDArray[np.uint16]) -> NDArray[np.float32]:
    return np.where(packed == 0, np.float32(np.nan), packed / np.float32(DISPARITY_STEPS)).astype(np.float32)
