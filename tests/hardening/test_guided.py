"""Readers under a fuzzer that is led by coverage: it finds ways into the code that random edits miss."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.hardening.targets import TARGETS

pytest.importorskip("atheris", reason="no Atheris for this Python: pip install atheris")

RUNS = 20_000 if "ENDOSDK_THOROUGH" in os.environ else 1_000


@pytest.mark.parametrize("name", TARGETS)
def test_inputs_led_by_coverage_give_typed_errors(name, tmp_path):
    (tmp_path / "seed").write_bytes(TARGETS[name].seed())
    command = [sys.executable, "-m", "tests.hardening.guided", name, str(tmp_path), str(RUNS)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    assert f"Done {RUNS} in" in done.stderr + done.stdout, done.stderr[-1000:]
