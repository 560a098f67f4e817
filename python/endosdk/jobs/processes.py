"""Who does the tasks of a long job: this process, several of this machine, or a Ray cluster."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from typing import Any, TypeVar

from endosdk.errors import DependencyMissing, InferenceFailed, InvalidArgument
from endosdk.io.extras import must_install

Task = TypeVar("Task")
Outcome = TypeVar("Outcome")

RETRIES = 20  # of a task whose worker was killed, before the run gives up


class WorkerKilled(Exception):
    """A process of this machine ended in the middle of a task."""


def work_apart(
    function: Callable[[Task], Outcome],
    tasks: Sequence[Task],
    workers: int,
    *,
    closing: Callable[[], None] | None = None,
) -> Iterator[Outcome]:
    """Do the tasks in several processes; yield what the function returns as tasks are finished.

    ``closing`` is called in a worker that control-C ends. Raises WorkerKilled where a worker is killed.
    """
    # Each process starts afresh: neither an OpenGL context nor the threads of a runtime survive a fork.
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_obey_the_parent, initargs=(closing,)) as pool:
        with _interrupts_held():
            futures = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            raise WorkerKilled(str(error)) from error
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold control-C back from this thread, and from the processes started meanwhile until they can answer it."""
    if sys.platform == "win32":  # has no such mask
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _obey_the_parent(closing: Callable[[], None] | None) -> None:
    """Let this worker end at control-C, which reaches it too, and when the process that started it is killed."""

    def end_now(*_: object) -> None:
        if closing is not None:
            with suppress(Exception):  # it may be at work
                closing()
        os._exit(1)

    signal.signal(signal.SIGINT, end_now)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # held back since before this process began
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def work_on_ray(
    function: Callable[[Task], Outcome], tasks: Sequence[Task], workers: int, *, cores: int = 1
) -> Iterator[Outcome]:
    """Do the tasks on a Ray cluster, that of $RAY_ADDRESS or one started here; yield as tasks are finished.

    ``workers`` tasks run at a time, each of which is counted as ``cores`` processors. A task whose worker dies is given
    to another. Raises DependencyMissing where Ray is not installed, InvalidArgument where no machine has so many
    processors, InferenceFailed where workers die of one task again and again.
    """
    # Ray would report its use to its makers over the network.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        raise DependencyMissing("ray", must_install("ray"), "nothing") from error
    started = not ray.is_initialized()
    if started:
        try:
            ray.init(log_to_driver=False, include_dashboard=False)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise InvalidArgument("ray", "must find the cluster of $RAY_ADDRESS, or start one here", error) from error
    try:
        nodes: list[dict[str, Any]] = ray.nodes()  # type: ignore[no-untyped-call]
        largest = max((node["Resources"].get("CPU", 0.0) for node in nodes if node["Alive"]), default=0.0)
        if cores > largest:
            rule = f"must be at most {largest:g}, the processors of the largest machine of the Ray cluster"
            raise InvalidArgument("threads", rule, cores)
        remote: Any = ray.remote(max_retries=RETRIES, num_cpus=cores)(_work)
        waiting = list(reversed(tasks))
        running: list[Any] = []
        while waiting or running:
            while waiting and len(running) < workers:
                running.append(remote.remote(function, waiting.pop()))
            finished, running = ray.wait(running)
            for reference in finished:
                yield ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from error  # ours, as raised in the worker
    except ray.exceptions.RayError as error:
        rule = f"a task must end within {RETRIES + 1} attempts on the Ray cluster; the same command goes on"
        raise InferenceFailed("ray", rule, f"{type(error).__name__}: {error}") from error
    finally:
        if started:
            ray.shutdown()


def _work(function: Callable[[Task], Outcome], task: Task) -> Outcome:
    return function(task)
