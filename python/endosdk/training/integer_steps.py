"""The step of 8-bit weights: what the quantiser writes, and what training rounds to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEAST_CHANNELS = 12  # channels from which a convolution is quicker in integers
LEVELS = 255  # steps between the smallest and the largest activation
# Without VNNI a processor multiplies two neighbouring values by their weights and adds the products in 16 bits, which
# hold 255 times 128. One less, because either weight may be rounded up.
PAIR_SUM = 127


def unsaturated_steps(weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Choose the 8-bit step of each row of weights [rows, ...] so that no sum of two products exceeds 16 bits.

    A step is at least a 127th of the largest weight, and so large that of every two weights that a processor without
    VNNI multiplies together, those of one sign come to at most 128 steps.
    """
    rows = weights.reshape(len(weights), -1)
    pairs = np.pad(rows, ((0, 0), (0, rows.shape[1] % 2))).reshape(len(rows), -1, 2)
    sums = [np.maximum(sign * pairs, 0).sum(axis=2).max(axis=1) for sign in (1, -1)]
    largest = np.maximum(*sums) / PAIR_SUM  # no weight exceeds the sum of its pair
    return np.where(largest > 0, largest, 1).astype(np.float32)


def convolution_steps(weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Choose the step of each output of a convolution [outputs, inputs, ...] by `unsaturated_steps`.

    Runtimes take the values under a kernel cell by cell, all channels of a cell together.
    """
    return unsaturated_steps(np.moveaxis(weights, 1, -1))
