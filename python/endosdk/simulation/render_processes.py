"""Who renders: this process, several of this machine, or a Ray cluster. Each gives the same set."""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from functools import partial

from endosdk.errors import RendererUnavailable
from endosdk.jobs.processes import WorkerKilled, work_apart, work_on_ray
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.tasks import Job, Task, render_task, start_renderer


def render_here(job: Job, tasks: list[Task]) -> Iterator[int]:
    """Render one task after the other; yield the number of samples as they are finished."""
    renderer = start_renderer(job)
    try:
        for task in tasks:
            yield from render_task(renderer, job, task)
    finally:
        renderer.close()


def render_apart(job: Job, tasks: list[Task], workers: int) -> Iterator[int]:
    """Render in several processes; yield the number of samples as tasks are finished."""
    try:
        yield from work_apart(partial(_render, job), tasks, workers, closing=_close_renderers)
    except WorkerKilled as error:
        rule = "a worker was killed, perhaps for want of memory; the same command continues the set"
        raise RendererUnavailable("workers", rule, error) from error


def render_on_ray(job: Job, tasks: list[Task], workers: int) -> Iterator[int]:
    """Render on a Ray cluster: that of $RAY_ADDRESS, or one started here; yield as tasks are finished.

    A task whose worker dies is given to another. Raises DependencyMissing where Ray is not installed.
    """
    yield from work_on_ray(partial(_render, job), tasks, workers)


# Each worker process keeps its renderers: starting one anew for every sample would cost more than drawing it.
_renderers: dict[str, Renderer] = {}


def _render(job: Job, task: Task) -> int:
    kind = f"{job.recipe.renderer} {job.cycles_python}"
    if kind not in _renderers:
        _renderers[kind] = start_renderer(job)
    return sum(render_task(_renderers[kind], job, task))


@atexit.register
def _close_renderers() -> None:
    while _renderers:
        _renderers.popitem()[1].close()
