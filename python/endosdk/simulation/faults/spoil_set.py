"""Spoil every pair of a set on disk: the same scenes and the same truth, in worse pictures."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from endosdk.datasets.dataset import SPLITS, Sample, film_of, read_record, read_sample_record
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.errors import DatasetInvalid, InvalidArgument, StorageFailed
from endosdk.io.progress import progress as progress_bar
from endosdk.simulation.faults.spoil import draw_faults, spoil
from endosdk.simulation.recipe import check_seed
from endosdk.simulation.tasks import RIG_FILE


def spoil_set(source: str | Path, root: str | Path, seed: int, progress: bool = True) -> dict[str, Any]:
    """Write the spoiled pairs of the set at ``source`` into the new folder ``root``; return their record.

    A pair's faults follow from ``seed`` and its id. Raises InvalidArgument where ``root`` holds anything, or for a seed
    that no set may have, DatasetInvalid where the source is not a complete set or has faults already, StorageFailed
    where the new one cannot be written.
    """
    check_seed(seed)
    readers = {split: open_dataset(source, split) for split in SPLITS}
    for split, reader in readers.items():
        for folder in (Path(source) / split / sample_id for sample_id in reader.ids):
            if "faults" in read_sample_record(folder).get("info", {}):
                raise DatasetInvalid("spoil", "must be a set without image faults; this sample has some", folder)
            if (folder / RIG_FILE).exists():
                raise DatasetInvalid("spoil", "must be a set of rectified pairs; this sample has raw views", folder)
        if any(film_of(sample_id) != sample_id for sample_id in reader.ids):
            raise DatasetInvalid(
                "spoil", "must be a set of single pairs: each frame would get faults of its own", source
            )
    out = Path(root)
    try:
        out.mkdir(parents=True, exist_ok=True)
        occupied = any(out.iterdir())
    except OSError as error:
        raise StorageFailed("out", "the folder must be writable", f"{out}: {error}") from error
    if occupied:
        raise InvalidArgument("out", "must be an empty or new folder", out)
    samples: dict[str, dict[str, str]] = {}
    for split, reader in readers.items():
        samples[split] = {}
        for sample in progress_bar(reader, total=len(reader), shown=progress):
            samples[split][sample.id] = write_sample(out, split, _spoilt(sample, seed))
    whole = readers[SPLITS[0]]
    record = {
        **read_record(Path(source)),
        "name": out.resolve().name,
        "spoiled_from": {"name": whole.name, "sha256": whole.sha256},
        "seed": seed,
        "samples": samples,
    }
    write_dataset_record(out, record)
    return record


def _spoilt(sample: Sample, seed: int) -> Sample:
    drawn = (seed, zlib.crc32(sample.id.encode()))
    faults = draw_faults((*drawn, 22), sample.left.shape[0] / sample.left.shape[1])
    if faults is None:
        return replace(sample, info={**sample.info, "faults": None})
    return spoil(sample, faults, (*drawn, 23))
