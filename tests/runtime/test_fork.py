"""A forked child may open estimators of its own. Those of its parent refuse it, instead of waiting for ever."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT

PROGRAM = """
import os, sys, threading, time
sys.path.insert(0, {root!r})
from endosdk import DepthEstimator, errors
from tests.conftest import TINY_MODEL, shifted_pair

pair = shifted_pair(96, 160, 9)
estimator = DepthEstimator(TINY_MODEL, threads=2)
expected = estimator.predict(*pair).disparity.tobytes()
stream = iter(estimator.stream([pair, pair]))
next(stream)
over = threading.Event()

def work():
    while not over.is_set():
        estimator.predict(*pair)

busy = threading.Thread(target=work)
if {busy}:
    busy.start()
    time.sleep(0.1)
child = os.fork()
if child == 0:
    calls = [
        lambda: estimator.predict(*pair),
        lambda: estimator.prepare(64, 64),
        lambda: estimator.rectify(*pair),
        estimator.rectified_pair,
        estimator.self_test,
        estimator.diagnostics,
        estimator.cancel,
        lambda: next(stream),
        lambda: next(estimator.stream([pair])),
    ]
    for call in calls:
        try:
            call()
        except errors.InvalidArgument as error:
            assert "must be used in the process that opened it" in str(error), error
        else:
            raise AssertionError("the parent's estimator answered")
    estimator.close()
    own = DepthEstimator(TINY_MODEL, threads=2)
    assert own.predict(*pair).disparity.tobytes() == expected
    print("child done", flush=True)
    sys.exit(0)  # frees everything, as a program does at its end
status = os.waitpid(child, 0)[1]
over.set()
if {busy}:
    busy.join()
assert estimator.predict(*pair).disparity.tobytes() == expected
sys.exit(status != 0)
"""


@pytest.mark.parametrize("busy", [False, True], ids=["idle", "predicting"])
@pytest.mark.filterwarnings("ignore")
def test_a_forked_child_is_refused_by_its_parents_estimator(busy):
    program = PROGRAM.format(root=str(ROOT), busy=busy)
    command = [sys.executable, "-W", "ignore", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "child done" in done.stdout
