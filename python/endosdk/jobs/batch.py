"""Depth of every stereo pair of an archive: two folders of pictures in, a folder of maps for each pair out.

A pair's folder appears whole or not at all, and holds the same whoever computed it: this process, several, or a Ray
cluster whose machines all see the folders. So a batch that was stopped is continued by starting it again.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from endosdk.calibration.rig import StereoCalibration
from endosdk.errors import CalibrationSizeMismatch, DatasetInvalid, InferenceFailed, InvalidArgument
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.documents import parse_json
from endosdk.io.file_hash import file_sha256
from endosdk.io.locks import locked_folder
from endosdk.io.picture_pairs import pair_pictures
from endosdk.io.pictures import check_bits, read_frame
from endosdk.io.progress import progress
from endosdk.io.resumable_folder import claim_folder, difference
from endosdk.io.whole_files import remove_partials, whole_folder, write_text
from endosdk.jobs.processes import WorkerKilled, work_apart, work_on_ray
from endosdk.runtime.arguments import Picture
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.limits import DEFAULT_LIMITS, Limits
from endosdk.runtime.models import shipped_models
from endosdk.runtime.result import Cause, DepthResult
from endosdk.runtime.result_files import RESULT, write_maps, write_record

FORMAT_VERSION = 4  # a pair of an older batch lacks files, or has a disparity.png that means something else
RECORD = "batch.json"
PAIRS = "pairs"  # folder of the pairs' folders
LARGEST_RESULT = 1 << 20  # bytes
SHARE = 8  # pairs that a worker is given at a time
# They compare a frame with those before it. The pairs of an archive are of no sequence, and which one comes after which
# depends on the workers.
OF_SEQUENCES = {Cause.FROZEN, Cause.NOT_SIMULTANEOUS}


class PairFiles(NamedTuple):
    """The two pictures of a pair, and the name of its folder."""

    name: str
    left: Path
    right: Path


@dataclass(frozen=True)
class Settings:
    """What the maps depend on, beside the pictures."""

    model: str  # shipped name or path
    calibration: StereoCalibration | None = None  # None: the pairs are rectified, and there is no depth
    network_size: tuple[int, int] | None = None
    provider: str = "cpu"
    provider_options: Mapping[str, str] | None = None
    threads: int | None = None  # of one worker; the maps do not depend on it
    limits: Limits = DEFAULT_LIMITS
    bits: int | None = None  # used bits of pictures that have 16; see `read_frame`


def find_pairs(left: str | Path, right: str | Path) -> list[PairFiles]:
    """Match the pictures of two folders as `pair_pictures` does; a pair goes by the name of its left picture."""
    matched = pair_pictures(Path(left).resolve(), Path(right).resolve())
    return [PairFiles(left_file.stem, left_file, right_file) for left_file, right_file in matched]


def run_batch(
    pairs: Sequence[PairFiles], settings: Settings, out: str | Path, *, workers: int = 1, ray: bool = False
) -> dict[str, Any]:
    """Compute what is missing in ``out`` with a progress bar; return the record, which is also ``out/batch.json``.

    ``workers`` is how many processes work at a time, on this machine or, with ``ray``, on the cluster. The record has
    the settings, how many pairs got which `Status` and which `Cause`, and ``failed``: the error of each pair whose
    pictures cannot be used; these are tried again the next time. Raises InvalidArgument where ``out`` holds a batch of
    other settings or another process is at work there, StorageFailed where it cannot be written, DatasetInvalid where
    the maps of a finished pair are no longer those that were written or its pictures no longer those that were read,
    InferenceFailed where a worker is killed.
    """
    if workers < 1:
        raise InvalidArgument("workers", "must be at least 1", workers)
    if ray and settings.provider != "cpu":
        raise InvalidArgument("provider", "must be cpu on a Ray cluster", settings.provider)
    if settings.model not in shipped_models():
        settings = replace(settings, model=str(Path(settings.model).resolve()))  # workers start in other folders
    # Here too, before anything is written: a wrong setting is refused, and all workers must load this very model.
    model = _opened(settings).model
    described = {
        "model": model.identity(),
        "calibration_sha256": None if settings.calibration is None else settings.calibration.sha256,
        "network_size": None if settings.network_size is None else list(settings.network_size),
        "provider": settings.provider,
        "provider_options": dict(settings.provider_options or {}),
        **settings.limits.described(),
        "bits": check_bits(settings.bits),
    }
    job = _Job(Path(out).resolve(), settings, model.sha256)
    fresh = {"format_version": FORMAT_VERSION, "settings": described}
    with locked_folder(job.out, "out"):
        claim_folder(
            job.out,
            RECORD,
            fresh,
            lambda begun: difference({name: begun.get(name) for name in fresh}, fresh),
            "must be new, or a batch of the same model, rig, size, limits, bits and provider, by this version",
        )
        missing = [pair for pair in pairs if not job.folder(pair).is_dir()]
        for pair in set(pairs).difference(missing):
            _check_finished(job.folder(pair), pair)
        failed = _compute(job, missing, workers, ray)
        finished = [_finished(job.folder(pair)) for pair in pairs if pair.name not in failed]
        record = {
            **fresh,
            "status": dict(Counter(one["status"] for one in finished)),
            "causes": dict(Counter(cause for one in finished for cause in one["causes"])),
            "failed": failed,
        }
        remove_partials(job.out)
        write_text(job.out / RECORD, json.dumps(record, indent=1) + "\n", "out")
        return record


def _finished(folder: Path) -> dict[str, Any]:
    """Return the record of a finished pair."""
    try:
        record = parse_json(read_bounded(folder / RESULT, LARGEST_RESULT).decode())
        return {
            "status": str(record["status"]),
            "causes": list(dict(record["causes"])),
            "files": dict(record["files"]),
            "inputs": dict(record["inputs_sha256"]),
        }
    except (Refused, ValueError, KeyError, TypeError) as error:
        raise _changed(folder, f"{RESULT}: {error}") from error


def _check_finished(folder: Path, pair: PairFiles) -> None:
    """Compare the pictures and the files of a finished pair with the hashes recorded when it was written."""
    found = _finished(folder)
    recorded = found["files"]
    try:
        if found["inputs"] != {"left": file_sha256(pair.left), "right": file_sha256(pair.right)}:
            rule = "a finished pair is of other pictures; name another folder, or delete that of the pair"
            raise DatasetInvalid("out", rule, f"{folder}: not of {pair.left} and {pair.right}")
        present = {path.name for path in folder.iterdir()} - {RESULT}
        if present != recorded.keys():
            raise _changed(folder, f"files {sorted(present)} instead of {sorted(recorded)}")
        for name, sha256 in recorded.items():
            if file_sha256(folder / name) != sha256:
                raise _changed(folder, f"{name} holds other bytes than were written")
    except OSError as error:
        raise _changed(folder, error) from error


def _changed(folder: Path, seen: object) -> DatasetInvalid:
    rule = "a finished pair was changed; delete its folder, and the same command computes it again"
    return DatasetInvalid("out", rule, f"{folder}: {seen}")


@dataclass(frozen=True)
class _Job:
    out: Path
    settings: Settings
    model_sha256: str

    def folder(self, pair: PairFiles) -> Path:
        return self.out / PAIRS / pair.name


def _compute(job: _Job, missing: list[PairFiles], workers: int, ray: bool) -> dict[str, str]:
    """Compute the missing pairs; return the errors of those whose pictures cannot be used, by name."""
    errors: dict[str, str] = {}
    with progress(total=len(missing)) as bar:
        for found in _shares(job, missing, workers, ray):
            errors.update({name: error for name, error in found.items() if error is not None})
            bar.update(len(found))
    return dict(sorted(errors.items()))


def _shares(job: _Job, missing: list[PairFiles], workers: int, ray: bool) -> Iterator[dict[str, str | None]]:
    if not missing:
        return
    if workers == 1 and not ray:
        yield from (_answer_all(job, [pair]) for pair in missing)
        return
    tasks = [missing[first : first + SHARE] for first in range(0, len(missing), SHARE)]
    work = partial(_answer_all, job)
    if ray:
        yield from work_on_ray(work, tasks, workers, cores=job.settings.threads or 1)
        return
    try:
        yield from work_apart(work, tasks, workers)
    except WorkerKilled as error:
        rule = "a worker was killed, perhaps for want of memory; the same command continues the batch"
        raise InferenceFailed("workers", rule, error) from error


# Each process keeps its last estimator: loading a model anew for every share would cost more than running it.
_estimators: dict[tuple[object, ...], DepthEstimator] = {}


def _opened(settings: Settings) -> DepthEstimator:
    rig = settings.calibration
    options = tuple(sorted((settings.provider_options or {}).items()))
    session = (settings.network_size, settings.provider, options, settings.threads)
    key = (settings.model, rig and rig.sha256, *session, settings.limits)
    if key not in _estimators:
        _estimators.clear()
        _estimators[key] = DepthEstimator(
            settings.model,
            calibration=rig,
            provider=settings.provider,
            provider_options=settings.provider_options,
            threads=settings.threads,
            network_size=settings.network_size,
            **settings.limits._asdict(),
        )
    return _estimators[key]


def _answer_all(job: _Job, pairs: list[PairFiles]) -> dict[str, str | None]:
    """Answer some pairs; return the error of each, None where there was none."""
    estimator = _opened(job.settings)
    if estimator.model.sha256 != job.model_sha256:
        # A processor without instructions for 8-bit integers gets the float32 model.
        rule = "every machine of the cluster must load the same; name a model in floats"
        raise InvalidArgument("model", rule, f"{estimator.model.name} on one of them")
    # A pair may be there already: of a worker that was killed before it had done its share.
    return {pair.name: None if job.folder(pair).is_dir() else _answer(job, estimator, pair) for pair in pairs}


def _answer(job: _Job, estimator: DepthEstimator, pair: PairFiles) -> str | None:
    try:
        left, right = (read_frame(path, bits=job.settings.bits) for path in (pair.left, pair.right))
        result = _alone(estimator, left, right)
    except (InvalidArgument, CalibrationSizeMismatch) as error:
        return str(error)
    with whole_folder(job.folder(pair), job.out) as folder:
        files = write_maps(folder, estimator.rectify(left, right)[0], result)
        write_record(folder, result, files, (pair.left, pair.right))
    return None


def _alone(estimator: DepthEstimator, left: Picture, right: Picture) -> DepthResult:
    """Return the answer of a pair that no other pair was seen before."""
    result = estimator.predict(left, right)
    if OF_SEQUENCES.isdisjoint(result.causes):
        return result
    (result,) = estimator.stream([(left, right)])  # a stream knows its own frames alone
    return result
