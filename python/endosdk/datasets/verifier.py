"""Tell whether the samples of a set are, byte for byte, those that its record names."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from endosdk.datasets.dataset import SPLITS, read_record
from endosdk.datasets.sample_hash import hash_sample
from endosdk.errors import DatasetInvalid


def verify_dataset(root: str | Path) -> Iterator[tuple[str, str | None]]:
    """Yield (split/id, fault) for each sample: None when its bytes are those recorded, else what is wrong."""
    root = Path(root)
    record = read_record(root)
    for split in SPLITS:
        recorded = record["samples"][split]
        for sample_id in sorted(recorded):
            yield f"{split}/{sample_id}", _fault(root / split / sample_id, recorded[sample_id])
        for folder in sorted(p for p in (root / split).glob("*") if p.name not in recorded):
            yield f"{split}/{folder.name}", "not in dataset.json"


def _fault(folder: Path, recorded: str) -> str | None:
    """Say what is wrong with a sample; None where its hash is the one ``recorded``."""
    if not folder.is_dir():
        return "missing"
    try:
        return None if hash_sample(folder) == recorded else "its bytes differ from those recorded"
    except DatasetInvalid as error:
        return f"{error.rule}; got {error.value}"
