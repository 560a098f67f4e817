"""A forked child of a program in C: its parent's estimators and streams refuse it, and closing them does nothing."""

import subprocess
import sys

from tests.conftest import ROOT, TINY_MODEL

PROGRAM = f"""
import ctypes, os, sys, threading, time
sys.path.insert(0, {str(ROOT)!r})
from tests.c_library import binding as c
from tests.conftest import shifted_pair

library = c.load(c.Path(sys.argv[1]))
pair = shifted_pair(96, 160, 9)
estimator = c.CEstimator(library, c.Path({str(TINY_MODEL)!r}), threads=2)
stream = ctypes.c_void_p()
assert library.endo_stream_open(estimator.handle, 160, 96, None, ctypes.byref(stream)) == 0
over = threading.Event()

def work():
    while not over.is_set():
        estimator.predict(*pair, maps=("disparity",))

busy = threading.Thread(target=work)
busy.start()
time.sleep(0.1)
child = os.fork()
if child == 0:
    calls = [
        lambda: estimator.predict(*pair, maps=("disparity",)),
        estimator.self_test,
        estimator.diagnostics,
        lambda: estimator.set_calibration(None),
        lambda: estimator._check(library.endo_cancel(estimator.handle)),
        lambda: estimator._check(library.endo_stream_end(stream)),
    ]
    for call in calls:
        try:
            call()
        except c.CError as error:
            assert error.name == "INVALID_ARGUMENT" and "the process that opened it" in str(error), error
        else:
            raise AssertionError("the parent's estimator answered")
    library.endo_stream_close(stream)
    estimator.close()
    own = c.CEstimator(library, c.Path({str(TINY_MODEL)!r}), threads=2)
    own.self_test()
    own.close()
    print("child done", flush=True)
    os._exit(0)
status = os.waitpid(child, 0)[1]
over.set()
busy.join()
library.endo_stream_close(stream)
estimator.self_test()
estimator.close()
sys.exit(status != 0)
"""


def test_a_forked_child_is_refused_by_its_parents_estimator(installed):
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, str(installed.library)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "child done" in done.stdout
