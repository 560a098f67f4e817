"""The library's own test programs, plain and under sanitizers."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.c_library.conftest import SANITIZED


def run_tests(folder: Path, pattern: str) -> None:
    command = ["ctest", "--test-dir", str(folder), "--output-on-failure", "--no-tests=error", "-R", pattern]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:]


def test_programs(installed):
    run_tests(installed.build, ".")


def test_under_sanitizers(sanitized):
    run_tests(sanitized, f"^({'|'.join(SANITIZED)})(_corpus)?$")
