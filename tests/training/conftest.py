from __future__ import annotations

import pytest
import torch

from endosdk.datasets.sample_hash import hash_sample
from tests.training.exported_networks import Exported, shared_folder
from tests.training.warped_set import write_warped_set

SIZE = (128, 256)


@pytest.fixture(autouse=True, scope="session")
def one_thread():
    """Keep sums in one order. Several test processes share the cores: threads that wait for each other burn them."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def dataset_root(tmp_path_factory):
    """A set of ten training and two test pairs on disk."""
    root = tmp_path_factory.mktemp("set") / "warped"
    hashes = write_warped_set(root, 10, 2, SIZE, (3.0, 26.0))
    assert hash_sample(root / "train" / "0000") == hashes["train"]["0000"]
    return root


class ExportedOnce(dict):
    """Networks and their files by name, each made when it is first asked for."""

    def __init__(self, folder):
        super().__init__()
        self.folder = folder

    def __missing__(self, name):
        self[name] = Exported(self.folder, name)
        return self[name]


@pytest.fixture(scope="session")
def exported():
    return ExportedOnce(shared_folder())
