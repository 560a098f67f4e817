"""One task of a data set: a pair or a video, rendered by the renderer of its recipe and written at its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_picture, write_sample
from endosdk.simulation.cycles.blender import CyclesRenderer
from endosdk.simulation.cycles.environment import find_python
from endosdk.simulation.faults.spoil import draw_faults, spoil
from endosdk.simulation.objects.pair import render_objects
from endosdk.simulation.organ import SHARED_BY, render_organ
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.recipe import Recipe
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.rigs import OBJECT_SPANS, ORGAN_SPANS, SceneRig, Spans, draw_camera, draw_range
from endosdk.simulation.sample import render_sample
from endosdk.simulation.scene import LAP, SHAPES
from endosdk.simulation.stereo_video import render_video, write_video
from endosdk.simulation.unrectified import draw_rig, render_raw_sample

RIG_FILE = "rig.json"  # beside the raw views of a pair

Task = tuple[str, int]  # split, seed


@dataclass(frozen=True)
class Job:
    """A set that is being rendered."""

    root: Path
    recipe: Recipe
    cycles_python: Path | None = None

    def folders(self, task: Task) -> list[Path]:
        """Return the sample folders that a task makes."""
        return [self.root / task[0] / name for name in self.recipe.names(task[1])]

    def video(self, task: Task) -> Path:
        """Return where the film of a task is written."""
        return self.root / "videos" / f"{task[0]}-{task[1]:09d}.mp4"

    def is_done(self, task: Task) -> bool:
        """Return whether all that a task makes is there."""
        return all(folder.is_dir() for folder in self.folders(task)) and (
            not self.recipe.frames or self.video(task).exists()
        )

    def check(self) -> None:
        """Raise RendererUnavailable or DependencyMissing before anything is written where the renderer cannot start."""
        if self.recipe.renderer == "cycles":
            find_python(self.cycles_python)
        Rasteriser().close()


def start_renderer(job: Job) -> Renderer:
    """Start the renderer that a job asks for. Raises RendererUnavailable or DependencyMissing."""
    return CyclesRenderer(find_python(job.cycles_python)) if job.recipe.renderer == "cycles" else Rasteriser()


def render_task(renderer: Renderer, job: Job, task: Task) -> Iterator[int]:
    """Render what is missing of a task; yield the number of samples that each step has finished."""
    if job.recipe.frames:
        yield from _video(renderer, job, task)
        return
    if not job.is_done(task):  # another run on the same folder may have been quicker
        _pair(renderer, job, task)
    yield 1


def _pair(renderer: Renderer, job: Job, task: Task) -> None:
    recipe, (split, seed) = job.recipe, task
    if recipe.rig != "raw":
        write_sample(job.root, split, _rectified(renderer, recipe, seed))
        return
    # One rig takes the whole set, as in life.
    rig = draw_rig(recipe.seed, recipe.camera)
    sample, raw = render_raw_sample(renderer, rig, seed, recipe.organ, recipe.limits, recipe.effects)
    extras: dict[str, Callable[[Path], object]] = {
        "raw_left.png": partial(write_picture, image=raw.left),
        "raw_right.png": partial(write_picture, image=raw.right),
        RIG_FILE: raw.calibration.save,
    }
    write_sample(job.root, split, sample, extras)


def _rectified(renderer: Renderer, recipe: Recipe, seed: int) -> Sample:
    """Render a pair of an ideal or a drawn rig, spoiled where the recipe asks for it."""
    if recipe.organ == SHAPES:
        sample = render_objects(renderer, seed, _rig(recipe, seed, OBJECT_SPANS))
    elif _shares_organs(recipe):
        rig = _rig(recipe, seed, ORGAN_SPANS)
        sample = render_organ(renderer, seed, recipe.organ, rig, recipe.effects, clean=recipe.faults)
    else:
        sample = render_sample(renderer, seed, recipe.organ, recipe.camera, recipe.limits, recipe.effects)
    if not recipe.faults:
        return sample
    faults = draw_faults((seed, 22), sample.left.shape[0] / sample.left.shape[1])
    return sample if faults is None else spoil(sample, faults, (seed, 23))


def pairs_per_organ(recipe: Recipe) -> int:
    """Return how many neighbouring seeds look at one organ."""
    return SHARED_BY if _shares_organs(recipe) else 1


def _shares_organs(recipe: Recipe) -> bool:
    return recipe.organ != SHAPES and (recipe.rig == "drawn" or recipe.organ == LAP)


def _rig(recipe: Recipe, seed: int, spans: Spans) -> SceneRig:
    rng = np.random.default_rng((seed, 19))
    camera = recipe.camera
    centre = ((camera.width - 1) / 2, (camera.height - 1) / 2)
    if recipe.rig == "drawn":
        camera, centre = draw_camera(rng, camera.width, None if recipe.aspect == "drawn" else camera.height)
    return draw_range(rng, camera, centre, recipe.limits.largest, spans)


def _video(renderer: Renderer, job: Job, task: Task) -> Iterator[int]:
    recipe, (split, seed) = job.recipe, task
    folders = job.folders(task)
    there = sum(folder.is_dir() for folder in folders)
    yield there
    if there < len(folders):
        samples = render_video(
            renderer, seed, recipe.organ, recipe.camera, recipe.limits, recipe.effects, recipe.frames,
            wanted=lambda frame: not folders[frame].is_dir(),
        )  # fmt: skip
        for sample in samples:
            write_sample(job.root, split, sample)
            yield 1
    if not job.video(task).exists():
        write_video(job.video(task), folders)
