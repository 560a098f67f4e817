"""The paper's fourth volume: its training pairs and its test pairs together, as a data set of links."""

from __future__ import annotations

from pathlib import Path

from endosdk.datasets.dataset import FORMAT_VERSION, read_record
from endosdk.datasets.writer import write_dataset_record
from endosdk.errors import InvalidArgument


def with_test_pairs(root: Path, pairs: int, out: Path) -> Path:
    """Make a set at ``out`` whose ``pairs`` training pairs end with all test pairs of ``root``; return its folder.

    Nothing is copied: the folders of its samples are links. The same call again finds it there.
    """
    record = read_record(root)
    train, test = (record["samples"][split] for split in ("train", "test"))
    kept = sorted(train)[: max(pairs - len(test), 0)]
    if len(kept) + len(test) != pairs or not kept:
        rule = f"must be {len(test) + 1} to {len(test) + len(train)}, so that all test pairs of {record['name']} fit in"
        raise InvalidArgument("train_pairs", rule, pairs)
    samples = {name: train[name] for name in kept} | test
    if len(samples) != pairs:
        raise InvalidArgument("data", "its splits must have no id in common", record["name"])
    (out / "train").mkdir(parents=True, exist_ok=True)
    for name in samples:
        link, split = out / "train" / name, "train" if name in kept else "test"
        if not link.is_symlink():
            link.symlink_to((root / split / name).resolve(), target_is_directory=True)
    said = {"format_version": FORMAT_VERSION, "name": f"{record['name']} with its test pairs"}
    write_dataset_record(out, {**said, "samples": {"train": samples, "test": {}}})
    return out
