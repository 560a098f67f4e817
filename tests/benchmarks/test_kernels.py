"""The benchmark of the kernels: both forms give the same answer, and a wrong one ends it."""

from types import SimpleNamespace

import cv2
import pytest

from benchmarks.speed import kernels
from benchmarks.speed.kernels import map_tasks, measure, rectify_tasks
from endosdk import _core


@pytest.mark.parametrize("kernel", ["rectify", "resize_depth"])
@pytest.mark.parametrize("size", [(320, 240), (960, 720)])
def test_every_method_gives_the_same_answer(restored_settings, kernel, size):
    row = measure(kernel, *size, 1, 1)
    assert row["size"] == f"{size[0]}x{size[1]}" and row["median_ms"]["ours"] > 0
    assert all(ratio > 0 for ratio in row["times_faster"].values())


@pytest.mark.parametrize("tasks_of", [rectify_tasks, map_tasks])
def test_an_answer_that_is_missing_ends_the_run(tasks_of):
    tasks, check = tasks_of(320, 240)
    for name, task in tasks.items():
        if name != "ours":
            task()
    with pytest.raises(SystemExit, match=r"benchmarks\.speed\.kernels: "):
        check()


def test_medians_are_of_warm_runs_on_as_many_threads_as_asked(restored_settings, monkeypatch):
    """One run to check the answers and three to warm up take a second each, then one of three is disturbed."""
    clock = SimpleNamespace(now=0.0, perf_counter=lambda: clock.now)
    ran, threads = [], set()

    def task(name, *milliseconds):
        times = iter([1000] * 4 + list(milliseconds))

        def run():
            clock.now += next(times) / 1e3
            ran.append(name)
            threads.add((_core.threads(), cv2.getNumThreads()))

        return run

    tasks = {"ours": task("ours", 50, 2, 2), "opencv": task("opencv", 5, 4, 90)}
    monkeypatch.setattr(kernels, "time", clock)
    monkeypatch.setattr(kernels, "rectify_tasks", lambda width, height: (tasks, lambda: ran.append("checked")))
    before = cv2.getNumThreads()
    try:
        row = measure("rectify", 96, 64, 3, 3)
    finally:
        cv2.setNumThreads(before)
    assert row == {
        "kernel": "rectify",
        "size": "96x64",
        "threads": 3,
        "median_ms": {"ours": 2.0, "opencv": 5.0},
        "times_faster": {"opencv": 2.5},
    }
    assert threads == {(3, 3)}
    assert ran == ["ours", "opencv", "checked", *["ours", "opencv"] * 6]
