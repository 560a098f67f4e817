"""From loading the C library to its first depth map in a fresh process: bounded processor time and memory."""

import json
import subprocess
import sys

from tests.conftest import ROOT
from tests.runtime.test_start_up import MOST_MEMORY, MOST_PROCESSOR_S

PROGRAM = """
import json, sys, time
from pathlib import Path
import numpy as np
from endosdk import StereoCalibration, shipped_models
from endosdk.jobs.machine import peak_memory_mb
from tests.c_library import binding as c

rig = StereoCalibration.load("examples/data/rig.json")
left, right = np.random.default_rng(0).integers(0, 255, (2, 720, 960, 3), np.uint8)
begun = time.process_time()
estimator = c.CEstimator(c.load(Path(sys.argv[1])), shipped_models()["fast"], rig, threads=2)
estimator.self_test()
estimator.predict(left, right)
print(json.dumps([time.process_time() - begun, peak_memory_mb()]))
estimator.close()
"""


def test_the_first_answer_takes_little_time_and_about_the_memory_that_the_card_states(installed):
    command = [sys.executable, "-c", PROGRAM, str(installed.library)]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    seconds, peak_mb = json.loads(done.stdout)
    assert seconds < MOST_PROCESSOR_S
    stated = json.loads((ROOT / "benchmarks" / "results" / "speed" / "fast.json").read_text())
    assert peak_mb < MOST_MEMORY * stated["peak_rss_mb"]
