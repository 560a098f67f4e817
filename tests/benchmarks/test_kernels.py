"""The benchmark of the kernels: both forms give the same answer, and a wrong one ends it."""

import pytest

from benchmarks.speed.kernels import map_tasks, measure, rectify_tasks


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
