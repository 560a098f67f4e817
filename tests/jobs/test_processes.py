"""Control-C ends the workers of a job too, however far they have come."""

import os
import signal
import subprocess
import sys
import time

# Every worker reads this file anew before it can answer anything.
JOB = """
import os, pathlib, signal, sys, time
from endosdk.jobs.processes import work_apart
signal.signal(signal.SIGINT, signal.default_int_handler)
pathlib.Path(__file__).with_name(f"{os.getpid()}.begun").touch()
time.sleep(1)
if __name__ == "__main__":
    try:
        list(work_apart(time.sleep, [60] * 4, 2))
    except KeyboardInterrupt:
        sys.exit(130)
"""


def test_control_c_while_workers_start_ends_them_without_a_traceback(tmp_path):
    (tmp_path / "job.py").write_text(JOB)
    run = subprocess.Popen(
        [sys.executable, str(tmp_path / "job.py")], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    limit = time.monotonic() + 120
    while len(list(tmp_path.glob("*.begun"))) < 3:  # the job and its two workers
        assert run.poll() is None and time.monotonic() < limit
        time.sleep(0.02)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does to all of its processes
    said = run.communicate(timeout=60)[1]
    assert run.returncode == 130 and "Traceback" not in said
