"""A system that starts no further thread, as in a container with a limit: an error that says so, never a wait."""

import os
import subprocess
import sys

import pytest

from endosdk.errors import ErrorCode
from tests.conftest import ROOT, TINY_MODEL

THREADS = 8

# All is loaded before the user changes, who may not be able to read it. The superuser has no limit of threads.
PROGRAM = f"""
import os, resource, sys
from endosdk import DepthEstimator
from endosdk.errors import EndoError
from tests.conftest import shifted_pair

limit = int(sys.argv[1])
model = open({str(TINY_MODEL)!r}, "rb").read()
pair = shifted_pair(64, 96, 8)
with DepthEstimator(model, threads=1) as estimator:
    list(estimator.stream([pair]))
os.setgid(54321)
os.setuid(54321)
resource.setrlimit(resource.RLIMIT_NPROC, (limit, limit))

def tried(step):
    try:
        step()
        print("done")
    except EndoError as error:
        print(error.code.value, error)

estimators = []
tried(lambda: estimators.append(DepthEstimator(model, threads={THREADS})))
for estimator in estimators:
    tried(lambda: estimator.predict(*pair))
    tried(lambda: list(estimator.stream([pair] * 3)))
"""


def outcomes(limit: int) -> list[str]:
    """What became of opening, of one pair and of a stream, where the user may have so many threads."""
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, str(limit)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.skipif(sys.platform != "linux" or os.getuid() != 0, reason="only root can become a user with a limit")
@pytest.mark.parametrize("limit", [1, 2, 4, 6, 9, 12, 16, 20, 60])
def test_threads_that_run_out_are_one_error_wherever_they_are_missed(limit):
    code = str(ErrorCode.OUT_OF_MEMORY.value)
    said = outcomes(limit)
    assert all(line == "done" or line.startswith(f"{code} threads: the system must") for line in said), said
    opened = said[0] == "done"
    assert len(said) == (3 if opened else 1)
    assert opened == (limit > THREADS)
    assert ("done" in said[-1]) == (limit >= 3 * THREADS)  # the runtime's, the kernels' and the stream's own
