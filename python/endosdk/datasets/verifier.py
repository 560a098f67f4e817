"""Tell whether the samples of a set are, byte for byte, those that its record names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from endosdk.datasets.dataset import SPLITS, read_record
from endosdk.datasets.sample_hash import hash_sample


def verify_dataset(root: str | Path) -> Iterator[tuple[str, str | None]]:
    """Yield (split/id, fault) for each sample: None when its bytes are those recorded, else what is wrong."""
    root = Path(root)
    record = read_record(root)
    for split in SPLITS:
        recorded = record["samples"][split]
        for sample_id in sorted(recorded):
            folder = root / split / sample_id
            if not folder.is_dir():
                yield f"{split}/{sample_id}", "missing"
            elif hash_sample(folder) != recorded[sample_id]:
                yield f"{split}/{sample_id}", "its bytes differ from those recorded"
            else:
                yield f"{split}/{sample_id}", None
        for folder in sorted(p for p in (root / split).glob("*") if p.name not in recorded):
            yield f"{split}/{folder.name}", "not in dataset.json"
