"""PatchMatch takes more than a minute a pair, so its answers are kept one by one: scoring goes on where it stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.methods.patchmatch import PatchMatchSettings, match
from endosdk.datasets.dataset import Sample
from endosdk.evaluation.methods import Answer


def fresh_match(settings: PatchMatchSettings) -> Callable[[Sample], tuple[Answer, Answer]]:
    """Return the method that answers a pair everywhere, and only where both views agree."""

    def answer(sample: Sample) -> tuple[Answer, Answer]:
        started = time.perf_counter()
        checked, whole = match(sample.left, sample.right, settings)
        filled = Answer(whole, milliseconds=1e3 * (time.perf_counter() - started))
        return filled, replace(filled, disparity=checked)

    return answer


def kept_match(folder: Path, settings: PatchMatchSettings) -> Callable[[Sample], tuple[Answer, Answer]]:
    """Return the same method, which looks into ``folder`` first and leaves there what it had to compute."""
    fresh = fresh_match(settings)

    def answer(sample: Sample) -> tuple[Answer, Answer]:
        file = folder / f"{sample.id}.npz"
        if not file.exists():
            filled, bare = fresh(sample)
            file.parent.mkdir(parents=True, exist_ok=True)
            partial = file.with_suffix(".partial")
            with partial.open("wb") as stream:
                checked = np.isfinite(bare.disparity)
                np.savez_compressed(stream, whole=filled.disparity, checked=checked, milliseconds=filled.milliseconds)
            partial.replace(file)
        with np.load(file) as kept:
            filled = Answer(kept["whole"], milliseconds=float(kept["milliseconds"]))
            return filled, replace(filled, disparity=np.where(kept["checked"], filled.disparity, np.float32(np.nan)))

    return answer
