"""Readers under a fuzzer that is led by coverage: it finds ways into the code that random edits miss."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.hardening.targets import TARGETS

pytest.importorskip("atheris", reason="no Atheris for this Python: pip install atheris")

RUNS = 20_000 if "ENDOSDK_THOROUGH" in os.environ else 1_000


@pytest.fixture(scope="module")
def fuzzer():
    """The program that fuzzes: to import and to instrument takes longer than most of its runs."""
    command = [sys.executable, "-m", "tests.hardening.guided"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        yield program
        program.stdin.close()


@pytest.mark.parametrize("name", TARGETS)
def test_inputs_led_by_coverage_give_typed_errors(name, fuzzer, tmp_path):
    (tmp_path / "inputs").mkdir()
    (tmp_path / "inputs" / "seed").write_bytes(TARGETS[name].seed())
    fuzzer.stdin.write(f"{name}\t{tmp_path}\t{RUNS}\n")
    fuzzer.stdin.flush()
    status = fuzzer.stdout.readline().strip()
    said = (tmp_path / "fuzzer.log").read_text()
    assert status == "0", said[-4000:]
    assert f"Done {RUNS} in" in said, said[-1000:]
