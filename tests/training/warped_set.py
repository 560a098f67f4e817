"""Small sets on disk, made of warped scenes."""

from __future__ import annotations

from pathlib import Path

from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from tests.training.warped_scenes import warped_pair


def write_warped_set(
    root: Path, train: int, test: int, size: tuple[int, int], disparities: tuple[float, float]
) -> dict[str, dict[str, str]]:
    """Write `train` and `test` pairs under root: size (height, width) px, disparities (least, most) px.

    Returns the hash of each sample by split and id.
    """
    hashes: dict[str, dict[str, str]] = {"train": {}, "test": {}}
    for split, seeds in (("train", range(train)), ("test", range(100, 100 + test))):
        for seed in seeds:
            views = warped_pair(seed, size, disparities)
            sample = Sample(f"{seed:04d}", *views, None, None, focal_px=200.0, baseline_mm=5.0)
            hashes[split][sample.id] = write_sample(root, split, sample)
    write_dataset_record(root, {"format_version": 1, "name": root.name, "samples": hashes})
    return hashes
