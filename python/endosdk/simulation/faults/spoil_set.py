"""Spoil every pair of a set on disk: the same scenes and the same truth, in worse pictures."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from endosdk.datasets.dataset import RECORD, SPLITS, DatasetReader, Sample, film_of, read_record, read_sample_record
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.sample_hash import hash_sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.errors import DatasetInvalid
from endosdk.io.locks import locked_folder
from endosdk.io.progress import progress as progress_bar
from endosdk.io.resumable_folder import claim_folder, difference
from endosdk.simulation.faults.spoil import draw_faults, spoil
from endosdk.simulation.generate import RECIPE, check_place
from endosdk.simulation.recipe import check_seed
from endosdk.simulation.sample import GENERATOR_VERSION
from endosdk.simulation.tasks import RIG_FILE

CHANGED = "a finished sample was changed; delete its folder, and the same command writes it again"

Hashes = dict[str, dict[str, str]]  # of samples, by split and id


def spoil_set(source: str | Path, root: str | Path, seed: int, progress: bool = True) -> dict[str, Any]:
    """Write what is missing of the spoiled pairs of the set at ``source`` into ``root``; return their record.

    A pair's faults follow from ``seed`` and its id. A sample's folder appears whole or not at all, so a killed run is
    continued by calling this again. Raises InvalidArgument where ``root`` holds anything but this set or another
    process is at work there, or for a seed that no set may have, DatasetInvalid where the source is not a complete set
    or has faults already, or a finished sample was changed, StorageFailed where the new one cannot be written.
    """
    check_seed(seed)
    readers = {split: open_dataset(source, split) for split in SPLITS}
    for split, reader in readers.items():
        _check_source(Path(source), split, reader)
    whole = readers[SPLITS[0]]
    made_of = {"spoiled_from": {"name": whole.name, "sha256": whole.sha256}, "seed": seed}
    wanted = {"generator_version": GENERATOR_VERSION, **made_of}
    out = Path(root)
    check_place(out)
    with locked_folder(out, "out"):
        rule = "must be new, or hold a set begun with the same pairs and seed"
        claim_folder(out, RECIPE, wanted, lambda begun: difference(begun, wanted), rule)
        samples = _finished(out, readers)
        total = sum(map(len, readers.values()))
        done = sum(map(len, samples.values()))
        if done < total:
            (out / RECORD).unlink(missing_ok=True)
        with progress_bar(total=total, done=done, shown=progress) as bar:
            for split, reader in readers.items():
                for index, sample_id in enumerate(reader.ids):
                    if sample_id not in samples[split]:
                        samples[split][sample_id] = write_sample(out, split, _spoilt(reader[index], seed))
                        bar.update(1)
        record = {**read_record(Path(source)), "name": out.resolve().name, **made_of, "samples": samples}
        write_dataset_record(out, record)
        return record


def _check_source(source: Path, split: str, reader: DatasetReader) -> None:
    """Raise DatasetInvalid where pairs of a split have faults, or would lose what they are."""
    for folder in (source / split / sample_id for sample_id in reader.ids):
        if "faults" in read_sample_record(folder).get("info", {}):
            raise DatasetInvalid("spoil", "must be a set without image faults; this sample has some", folder)
        if (folder / RIG_FILE).exists():
            raise DatasetInvalid("spoil", "must be a set of rectified pairs; this sample has raw views", folder)
    if any(film_of(sample_id) != sample_id for sample_id in reader.ids):
        raise DatasetInvalid("spoil", "must be a set of single pairs: each frame would get faults of its own", source)


def _finished(out: Path, readers: dict[str, DatasetReader]) -> Hashes:
    """Return the hashes of the samples that are there. Raises DatasetInvalid where one is not as a record says."""
    recorded = read_record(out)["samples"] if (out / RECORD).exists() else {split: {} for split in SPLITS}
    found: Hashes = {split: {} for split in SPLITS}
    for split, reader in readers.items():
        for sample_id in reader.ids:
            folder = out / split / sample_id
            if not folder.is_dir():
                continue
            sha256 = hash_sample(folder)
            if recorded[split].get(sample_id, sha256) != sha256:
                raise DatasetInvalid("out", CHANGED, folder)
            found[split][sample_id] = sha256
    return found


def _spoilt(sample: Sample, seed: int) -> Sample:
    drawn = (seed, zlib.crc32(sample.id.encode()))
    faults = draw_faults((*drawn, 22), sample.left.shape[0] / sample.left.shape[1])
    if faults is None:
        return replace(sample, info={**sample.info, "faults": None})
    return spoil(sample, faults, (*drawn, 23))
