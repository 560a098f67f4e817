"""A whole data set from one recipe: resumable after a stop at any moment, whoever renders it."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from endosdk.datasets.dataset import FORMAT_VERSION, RECORD, SPLITS, read_record
from endosdk.datasets.sample_hash import hash_sample
from endosdk.datasets.writer import write_dataset_record
from endosdk.errors import DatasetInvalid, InvalidArgument
from endosdk.io.locks import LOCK, locked_folder
from endosdk.io.progress import progress as progress_bar
from endosdk.io.resumable_folder import claim_folder, difference
from endosdk.io.whole_files import PARTIAL, write_text
from endosdk.simulation.recipe import Recipe
from endosdk.simulation.render_processes import render_apart, render_here, render_on_ray
from endosdk.simulation.sample import GENERATOR_VERSION
from endosdk.simulation.scene import MIXTURES
from endosdk.simulation.tasks import Job, Task, pairs_per_organ

RECIPE = "recipe.json"
PREVIOUS = "dataset.previous.json"  # the record of a set that grows: what was finished must stay as it was
CHANGED = "a finished sample was changed; delete its folder, and the same command renders it again"


def generate(
    root: str | Path,
    recipe: Recipe,
    workers: int = 1,
    progress: bool = True,
    cycles_python: Path | None = None,
    ray: bool = False,
) -> dict[str, Any]:
    """Render what is missing of the set at ``root`` and declare it complete; return its record.

    A sample's folder appears whole or not at all, so a killed run is continued by calling this again. With ``ray``,
    ``workers`` is how many renderers run at a time on the cluster, all of whose machines must see ``root``.
    Raises InvalidArgument when ``root`` holds a set made by another recipe or another process is at work there,
    StorageFailed when it cannot be written, RendererUnavailable when the renderer cannot start, DatasetInvalid when a
    finished sample was damaged.
    """
    if workers < 1:
        raise InvalidArgument("workers", "must be at least 1", workers)
    job = Job(Path(root).resolve(), recipe, cycles_python)
    missing = [task for task in recipe.tasks() if not job.is_done(task)]
    if missing:
        job.check()
    check_place(job.root)
    with locked_folder(job.root, "out"):
        _claim(job.root, recipe)  # not before: what it removes and writes may be in use by another run
        _check_finished(job.root)
        if missing:
            _keep_hashes(job.root)
            _render_all(job, missing, workers, progress, ray)
        record = _record(job)
        write_dataset_record(job.root, record)
        (job.root / PREVIOUS).unlink(missing_ok=True)
        return record


def check_place(root: Path) -> None:
    """Refuse a folder of something else, which not even a lock may change. Raises InvalidArgument."""
    with suppress(OSError):  # of a folder that is not there, or that the lock names as one that cannot be written
        names = {path.name for path in root.iterdir()}
        if RECIPE not in names and not all(name == LOCK or name.startswith(PARTIAL) for name in names):
            raise InvalidArgument("out", "must be an empty or new folder, or one begun by this command", root)


def _claim(root: Path, recipe: Recipe) -> None:
    """Write the recipe into a new folder, or check that the folder was begun with the same one."""
    wanted = json.loads(json.dumps({"generator_version": GENERATOR_VERSION, **recipe.described()}, sort_keys=True))
    rule = "must be new, or hold a set begun with the same settings"
    begun = claim_folder(root, RECIPE, wanted, lambda begun: _misfit(wanted, begun), rule)
    if begun != wanted:
        write_text(root / RECIPE, json.dumps(wanted, indent=1) + "\n", "out")


def _latest_record(root: Path) -> str | None:
    return next((name for name in (RECORD, PREVIOUS) if (root / name).exists()), None)


def _keep_hashes(root: Path) -> None:
    """Declare a set unfinished and remember what is there; what was deleted is rendered anew, perhaps to other bits."""
    latest = _latest_record(root)
    if latest is None:
        return
    record = read_record(root, latest)
    for split in SPLITS:
        kept = {name: sha256 for name, sha256 in record["samples"][split].items() if (root / split / name).is_dir()}
        record["samples"][split] = kept
    write_text(root / PREVIOUS, json.dumps(record, indent=1, sort_keys=True) + "\n", "out")
    (root / RECORD).unlink(missing_ok=True)


def _check_finished(root: Path) -> None:
    """Raise DatasetInvalid where a sample of a set that was complete is no longer what its record says."""
    record = _latest_record(root)
    if record is None:
        return
    recorded = read_record(root, record)["samples"]
    for split in SPLITS:
        for name, sha256 in recorded[split].items():
            folder = root / split / name
            if folder.is_dir() and _hash(folder) != sha256:
                raise DatasetInvalid("out", CHANGED, folder)


def _hash(folder: Path) -> str:
    try:
        return hash_sample(folder)
    except DatasetInvalid as error:
        raise DatasetInvalid("out", CHANGED, f"{folder}: {error.value}") from error


def _misfit(wanted: dict[str, Any], begun: dict[str, Any]) -> str | None:
    """Return why a set cannot go on with these settings; it can with the same ones, or more pairs of the same seeds."""
    counts = {key: begun.get(key) for key in ("pairs", "test_pairs")}
    grown = {key: count for key, count in counts.items() if isinstance(count, int) and count <= wanted[key]}
    return difference(begun, {**wanted, **grown})


def _render_all(job: Job, tasks: list[Task], workers: int, shown: bool, ray: bool) -> None:
    frames = max(1, job.recipe.frames)
    total = len(job.recipe.tasks()) * frames
    if ray:
        finished = render_on_ray(job, tasks, workers)
    else:
        finished = render_here(job, tasks) if workers == 1 else render_apart(job, tasks, workers)
    unit = "frame" if job.recipe.frames else "pair"
    with progress_bar(total=total, done=total - len(tasks) * frames, unit=unit, shown=shown) as bar:
        for count in finished:
            bar.update(count)


def _record(job: Job) -> dict[str, Any]:
    recipe = job.recipe
    samples: dict[str, dict[str, str]] = {"train": {}, "test": {}}
    renderers: set[str] = set()
    seeds: dict[str, list[int]] = {}
    for split, seed in recipe.tasks():
        seeds.setdefault(split, [seed, seed])[1] = seed
        for name in recipe.names(seed):
            folder = job.root / split / name
            samples[split][name] = _hash(folder)
            try:
                renderers.add(json.loads((folder / "sample.json").read_text())["info"]["renderer"])
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise DatasetInvalid("out", CHANGED, f"{folder}: {error!r}") from error
    described = recipe.described()
    return {
        "format_version": FORMAT_VERSION,
        "name": job.root.name,
        "version": GENERATOR_VERSION,
        "generator_version": GENERATOR_VERSION,
        "renderers": sorted(renderers),
        "organ": recipe.organ,
        "rig": recipe.rig,
        "organ_shares": MIXTURES.get(recipe.organ, {recipe.organ: 1.0}),
        "seeds": seeds,
        "camera": _camera(recipe),
        "disparity_limits_px": asdict(recipe.limits),
        "pairs_per_organ": pairs_per_organ(recipe),
        "samples": samples,
        **{name: described[name] for name in ("effects", "frames", "aspect", "faults") if name in described},
    }


def _camera(recipe: Recipe) -> dict[str, Any]:
    """Return what all cameras of the set have in common."""
    camera = asdict(recipe.camera)
    if recipe.rig != "drawn":
        return camera
    return {name: camera[name] for name in (("width",) if recipe.aspect == "drawn" else ("width", "height"))}
