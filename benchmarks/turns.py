"""Methods take turns on the same pairs, because the speed of a machine changes while they are measured."""

from __future__ import annotations

from collections.abc import Iterator

from endosdk.datasets.dataset import Sample
from endosdk.evaluation.methods import Answer, Method
from endosdk.io.progress import progress


def answers_in_turns(methods: dict[str, Method], samples: list[Sample]) -> Iterator[tuple[str, Sample, Answer]]:
    """Yield the answer of every method to every pair, with the method's name.

    Each answers twice and the second answer counts: the first finds the caches as the method before has left them.
    """
    for sample in progress(samples):
        for name, method in methods.items():
            method(sample)
            yield name, sample, method(sample)
