"""A whole data set from one seed: many samples, several processes, resumable after a stop at any moment."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from endosdk.dataset import FORMAT_VERSION, hash_sample, write_picture, write_record, write_sample
from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.raw import draw_rig, render_raw_sample
from endosdk.simulation.sample import GENERATOR_VERSION, Limits, render_sample
from endosdk.simulation.scene import MIXTURES, check_organ

# Seeds of one set: training from the start of its block, testing from the middle, so that they never meet.
SEED_BLOCK = 1_000_000
TEST_OFFSET = 500_000
RIGS = ("ideal", "raw")  # raw adds what a distorted, misaligned rig sees, and its calibration


@dataclass(frozen=True)
class Recipe:
    """What determines a data set, given one version of the generator and of the renderer."""

    organ: str = "mix"
    pairs: int = 100
    test_pairs: int = 0
    seed: int = 1
    renderer: str = "gl"
    rig: str = "ideal"
    camera: StereoCamera = field(default_factory=StereoCamera)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check_organ(self.organ)
        if self.renderer != "gl":
            raise InvalidArgument("renderer", "must be gl", self.renderer)
        if self.rig not in RIGS:
            raise InvalidArgument("rig", f"must be one of {', '.join(RIGS)}", self.rig)
        for name in ("pairs", "test_pairs"):
            if not 0 <= getattr(self, name) <= TEST_OFFSET:
                raise InvalidArgument(name, f"must be within 0..{TEST_OFFSET}", getattr(self, name))
        if self.pairs + self.test_pairs == 0:
            raise InvalidArgument("pairs", "at least one pair must be asked for", 0)
        if not 0 <= self.seed < 10_000:
            raise InvalidArgument("seed", "must be within 0..9999", self.seed)

    def tasks(self) -> list[tuple[str, int]]:
        """Return (split, seed) of every sample."""
        start = self.seed * SEED_BLOCK
        train = [("train", start + k) for k in range(self.pairs)]
        return train + [("test", start + TEST_OFFSET + k) for k in range(self.test_pairs)]


def generate(root: str | Path, recipe: Recipe, workers: int = 1, progress: bool = True) -> dict[str, Any]:
    """Render what is missing of the set at ``root`` and declare it complete; return its record.

    A sample's folder appears whole or not at all, so a killed run is continued by calling this again.
    Raises InvalidArgument when ``root`` holds a set made by another recipe, StorageFailed when it cannot be written.
    """
    if workers < 1:
        raise InvalidArgument("workers", "must be at least 1", workers)
    root = Path(root)
    _claim(root, recipe)
    missing = [task for task in recipe.tasks() if not _folder(root, *task).is_dir()]
    if missing:
        (root / "dataset.json").unlink(missing_ok=True)
        _render_all(root, recipe, missing, workers, progress)
    record = _record(root, recipe)
    write_record(root, record)
    return record


def _claim(root: Path, recipe: Recipe) -> None:
    """Write the recipe into a new folder, or check that the folder was begun with the same one."""
    wanted = {"generator_version": GENERATOR_VERSION, **asdict(recipe)}
    path = root / "recipe.json"
    try:
        root.mkdir(parents=True, exist_ok=True)
        if path.exists():
            begun = json.loads(path.read_text())
            # More pairs of the same seeds extend a set; anything else would mix two sets.
            same = all(begun.get(key) == value for key, value in wanted.items() if key not in ("pairs", "test_pairs"))
            if not same or begun["pairs"] > recipe.pairs or begun["test_pairs"] > recipe.test_pairs:
                raise InvalidArgument("out", "must be new, or hold a set begun with the same settings", root)
        elif any(root.iterdir()):
            raise InvalidArgument("out", "must be an empty or new folder, or one begun by this command", root)
        path.write_text(json.dumps(wanted, indent=1, sort_keys=True) + "\n")
        for left_over in root.glob(".partial-*"):
            shutil.rmtree(left_over) if left_over.is_dir() else left_over.unlink()
    except OSError as error:
        raise StorageFailed("out", "the folder must be writable", f"{root}: {error}") from error


def _folder(root: Path, split: str, seed: int) -> Path:
    return root / split / f"{seed:09d}"


def _render_all(root: Path, recipe: Recipe, tasks: list[tuple[str, int]], workers: int, progress: bool) -> None:
    from tqdm import tqdm

    total = len(recipe.tasks())
    with tqdm(total=total, initial=total - len(tasks), unit="pair", disable=not progress, smoothing=0.1) as bar:
        finished = _render_here(root, recipe, tasks) if workers == 1 else _render_apart(root, recipe, tasks, workers)
        for _ in finished:
            bar.update()


def _render_here(root: Path, recipe: Recipe, tasks: list[tuple[str, int]]) -> Iterator[None]:
    renderer = Rasteriser()
    try:
        for split, seed in tasks:
            _make(renderer, root, recipe, split, seed)
            yield
    finally:
        renderer.close()


def _render_apart(root: Path, recipe: Recipe, tasks: list[tuple[str, int]], workers: int) -> Iterator[None]:
    # Each process starts afresh: an OpenGL context does not survive a fork.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(_work, root, recipe, task) for task in tasks]
        try:
            for future in as_completed(futures):
                future.result()
                yield
        finally:
            pool.shutdown(cancel_futures=True)


# Of this worker process: starting OpenGL anew for every sample would cost more than drawing it.
_renderers: list[Rasteriser] = []


def _work(root: Path, recipe: Recipe, task: tuple[str, int]) -> None:
    if not _renderers:
        _renderers.append(Rasteriser())
    _make(_renderers[0], root, recipe, *task)


def _make(renderer: Rasteriser, root: Path, recipe: Recipe, split: str, seed: int) -> None:
    if _folder(root, split, seed).is_dir():
        return  # another run on the same folder was quicker
    if recipe.rig == "ideal":
        write_sample(root, split, render_sample(renderer, seed, recipe.organ, recipe.camera, recipe.limits))
        return
    # One rig takes the whole set, as in life.
    rig = draw_rig(recipe.seed, recipe.camera)
    sample, raw = render_raw_sample(renderer, rig, seed, recipe.organ, recipe.limits)
    extras: dict[str, Callable[[Path], None]] = {
        "raw_left.png": partial(write_picture, image=raw.left),
        "raw_right.png": partial(write_picture, image=raw.right),
        "rig.json": raw.calibration.save,
    }
    write_sample(root, split, sample, extras)


def _record(root: Path, recipe: Recipe) -> dict[str, Any]:
    samples: dict[str, dict[str, str]] = {"train": {}, "test": {}}
    renderers = set()
    for split, seed in recipe.tasks():
        folder = _folder(root, split, seed)
        samples[split][folder.name] = hash_sample(folder)
        renderers.add(json.loads((folder / "sample.json").read_text())["info"]["renderer"])
    seeds = {split: [int(min(ids)), int(max(ids))] for split, ids in samples.items() if ids}
    return {
        "format_version": FORMAT_VERSION,
        "name": root.resolve().name,
        "version": GENERATOR_VERSION,
        "generator_version": GENERATOR_VERSION,
        "renderers": sorted(renderers),
        "organ": recipe.organ,
        "rig": recipe.rig,
        "organ_shares": MIXTURES.get(recipe.organ, {recipe.organ: 1.0}),
        "seeds": seeds,
        "camera": asdict(recipe.camera),
        "disparity_limits_px": asdict(recipe.limits),
        "samples": samples,
    }
