"""A host is shown every thread that an estimator starts, by number and name, and can set its cores."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from endosdk import DepthEstimator, errors
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

TASKS = Path("/proc/self/task")
pytestmark = pytest.mark.skipif(not TASKS.is_dir(), reason="needs Linux")

# In a process of its own: threads of the kernels serve all estimators, and may be there already.
PROGRAM = """
import json, os
from pathlib import Path
from endosdk import DepthEstimator
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

def tasks():
    return {int(task.name): (task / "comm").read_text().strip() for task in Path("/proc/self/task").iterdir()}

core = min(os.sched_getaffinity(0))
shown = []

def started(number, name):
    os.sched_setaffinity(number, [core])
    shown.append((number, name))

pair = shifted_pair(64, 96, 9)
steps = [tasks()]
estimator = DepthEstimator(TINY_MODEL, threads=3, calibration=raw_rig().scaled(96, 64), thread_started=started)
steps.append(tasks())
estimator.prepare(96, 64)
steps.append(tasks())
stream = estimator.stream(iter(lambda: pair, None), follow_rig=True)
next(stream)
steps.append(tasks())
cores = {number: list(os.sched_getaffinity(number)) for number in steps[-1]}
stream.close()
print(json.dumps({"core": core, "shown": shown, "steps": steps, "cores": cores}))
"""


def test_every_thread_is_shown_by_its_name_when_it_starts():
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, check=True, capture_output=True, text=True)
    seen = json.loads(done.stdout)
    before, *after = ({int(number): name for number, name in step.items()} for step in seen["steps"])
    shown = dict(seen["shown"])
    assert len(shown) == len(seen["shown"]), "each once"
    new = [[name for number, name in step.items() if number not in before] for step in after]
    sessions, kernels = ["endosdk-session"] * 2, ["endosdk-kernels"] * 2
    lanes = ["endosdk-stream"] * 4  # of which one draws the pairs
    assert [sorted(names) for names in new] == [
        sessions,
        sorted(sessions + kernels),
        sorted(sessions + kernels + lanes + ["endosdk-follow"]),
    ]
    assert shown == {number: name for number, name in after[-1].items() if number not in before}
    assert before.items() <= after[-1].items(), "no thread of the host is called otherwise"
    for number, cores in seen["cores"].items():
        assert (cores == [seen["core"]]) >= (int(number) in shown)


def test_estimators_that_open_at_once_are_shown_their_own_threads():
    found: dict[int, list[int]] = {number: [] for number in range(4)}
    own_name = (TASKS / str(threading.get_native_id()) / "comm").read_text()
    kept = []

    def open_one(number):
        kept.append(DepthEstimator(TINY_MODEL, threads=3, thread_started=lambda tid, _: found[number].append(tid)))

    openers = [threading.Thread(target=open_one, args=(number,)) for number in found]
    for opener in openers:
        opener.start()
    for opener in openers:
        opener.join()
    numbers = [tid for tids in found.values() for tid in tids]
    assert all(len(tids) == 2 for tids in found.values())
    assert len(set(numbers)) == len(numbers)
    assert {(TASKS / str(tid) / "comm").read_text() for tid in numbers} == {"endosdk-session\n"}
    assert (TASKS / str(threading.get_native_id()) / "comm").read_text() == own_name


def test_an_error_of_the_hosts_function_is_raised_as_it_is():
    own = TASKS / str(threading.get_native_id()) / "comm"
    name = own.read_text()

    def refuse(number, name):
        raise PermissionError(f"no priority for {name} {number}")

    with pytest.raises(PermissionError, match="no priority for endosdk-session"):
        DepthEstimator(TINY_MODEL, threads=2, thread_started=refuse)
    with pytest.raises(PermissionError, match="no priority for endosdk-stream"):
        list(DepthEstimator(TINY_MODEL, threads=1, thread_started=refuse).stream([shifted_pair(64, 96, 9)]))
    assert own.read_text() == name


@pytest.mark.parametrize("hook", [3, "chrt", os])
def test_what_is_no_function_is_refused(hook):
    with pytest.raises(errors.InvalidArgument, match="thread_started: must be a function"):
        DepthEstimator(TINY_MODEL, thread_started=hook)
