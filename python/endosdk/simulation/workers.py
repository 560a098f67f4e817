"""Who renders: this process, several of this machine, or a Ray cluster. Each gives the same set."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context, parent_process
from typing import Any

from endosdk.errors import DependencyMissing, RendererUnavailable
from endosdk.simulation.render import Job, Task, render_task, start_renderer
from endosdk.simulation.renderer import Renderer

RETRIES = 20  # of a task whose worker was killed, before the run gives up


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
    # Each process starts afresh: an OpenGL context does not survive a fork.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_obey_the_parent) as pool:
        futures = [pool.submit(_work, job, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            rule = "a worker was killed, perhaps for want of memory; the same command continues the set"
            raise RendererUnavailable("workers", rule, error) from error
        finally:
            pool.shutdown(cancel_futures=True)


def _obey_the_parent() -> None:
    """Let this worker end at control-C, which reaches it too, and when the process that started it is killed."""
    signal.signal(signal.SIGINT, _end_now)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_now(*_: object) -> None:
    for renderer in _renderers.values():
        with suppress(Exception):  # it may be drawing
            renderer.close()
    os._exit(1)


def _end_with_the_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


# Of this worker process: starting a renderer anew for every sample would cost more than drawing it.
_renderers: dict[str, Renderer] = {}


def _work(job: Job, task: Task) -> int:
    kind = f"{job.recipe.renderer} {job.cycles_python}"
    if kind not in _renderers:
        _renderers[kind] = start_renderer(job)
    return sum(render_task(_renderers[kind], job, task))


def render_on_ray(job: Job, tasks: list[Task], workers: int) -> Iterator[int]:
    """Render on a Ray cluster: that of $RAY_ADDRESS, or one started here; yield as tasks are finished.

    A task whose worker dies is given to another. Raises DependencyMissing where Ray is not installed.
    """
    # Ray would report its use to its makers over the network.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        raise DependencyMissing("ray", "needs Ray: pip install 'endosdk[ray]'", error) from error
    started = not ray.is_initialized()
    if started:
        ray.init(log_to_driver=False, include_dashboard=False)
    try:
        remote = ray.remote(max_retries=RETRIES)(_work)
        waiting = list(reversed(tasks))
        running: list[Any] = []
        while waiting or running:
            while waiting and len(running) < workers:
                running.append(remote.remote(job, waiting.pop()))
            finished, running = ray.wait(running)
            for reference in finished:
                yield ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from error  # ours, as raised in the worker
    finally:
        if started:
            ray.shutdown()
