"""A data set of one frame of noise with a known, even disparity, for tests that need no scene."""

import numpy as np

from endosdk.datasets.dataset import Sample


class OneFrame:
    name, sha256 = "one", "0" * 64

    def __init__(self, height, width):
        rng = np.random.default_rng(1)
        left, right = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
        self.sample = Sample("0", left, right, np.full((height, width), 20.0, np.float32), None, None, 400.0, 10.0)

    def __len__(self):
        return 1

    def __getitem__(self, index):
        return self.sample
