from __future__ import annotations

import pytest
import torch

from endosdk.dataset import SPLITS, Sample, hash_sample, write_record, write_sample
from tests.training.exported_networks import export_into
from tests.training.warped_scenes import warped_pair

SIZE = (128, 256)


@pytest.fixture(autouse=True, scope="session")
def two_threads():
    """Leave the machine's other work alone, and keep sums in one order."""
    torch.set_num_threads(2)


@pytest.fixture(scope="session")
def dataset_root(tmp_path_factory):
    """A set of ten training and two test pairs on disk."""
    root = tmp_path_factory.mktemp("set")
    hashes = {split: {} for split in SPLITS}
    for split, seeds in (("train", range(10)), ("test", range(100, 102))):
        for seed in seeds:
            left, right, truth = warped_pair(seed, SIZE, (3.0, 26.0))
            sample = Sample(f"{seed:04d}", left, right, truth, None, None, focal_px=200.0, baseline_mm=5.0)
            hashes[split][sample.id] = write_sample(root, split, sample)
    write_record(root, {"format_version": 1, "name": "warped", "samples": hashes})
    assert hash_sample(root / "train" / "0000") == hashes["train"]["0000"]
    return root


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    return {name: export_into(folder, name) for name in ("fast", "wang2020")}
