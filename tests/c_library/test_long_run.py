"""Ten thousand frames through the C library: memory, handles and threads do not grow."""

import json
import subprocess

from tests.c_library import binding as c
from tests.conftest import TINY_MODEL


def test_ten_thousand_frames_grow_nothing(installed):
    """The program itself fails where anything grew, or an answer changed."""
    program = next(installed.build.rglob("library_steadiness"))
    command = [program, c.runtime_library(), TINY_MODEL, "10000", "0"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert json.loads(done.stdout)["frames"] == 10_000
