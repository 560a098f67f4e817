"""Frames by the thousand beside busy processes, through the C library: every late one is marked, and nothing grows.

``ENDOSDK_SOAK_FRAMES=100000`` makes it as long as a release wants it.
"""

import json
import os
import subprocess

from endosdk.jobs.bench import burdened
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL

FRAMES = int(os.environ.get("ENDOSDK_SOAK_FRAMES", "3000"))


def test_late_frames_are_marked_and_nothing_grows_under_load(installed):
    """The program holds every frame against its own clock, and what it uses at the end against the beginning."""
    program = next(installed.build.rglob("library_soak"))
    with burdened(2):
        command = [program, c.runtime_library(), TINY_MODEL, str(FRAMES)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    seen = json.loads(done.stdout)
    assert seen["frames"] >= 2 * FRAMES  # one by one, and in a stream
    assert 0 < seen["late"] < seen["frames"], "without late frames, or without others, nothing was tried"
    print(done.stdout)
