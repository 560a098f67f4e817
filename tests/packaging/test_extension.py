"""The compiled module of the Python package, as its build left it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from endosdk import _core
from tests.conftest import ROOT

MODULE = Path(_core.__file__)
pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not shutil.which("readelf"), reason="needs Linux and binutils"
)


def output_of(*command: str | Path) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_the_module_is_hardened_and_exports_its_starts_alone() -> None:
    headers = output_of("readelf", "--wide", "--program-headers", "--dynamic", MODULE)
    assert "GNU_RELRO" in headers
    assert re.search(r"GNU_STACK.* RW ", headers)
    assert re.search(r"\(FLAGS\).*BIND_NOW|\(FLAGS_1\).*NOW", headers)
    assert "RPATH" not in headers and "RUNPATH" not in headers
    undefined = output_of("nm", "-D", "--undefined-only", MODULE)
    assert "__stack_chk_fail" in undefined
    assert "socket" not in undefined and "getaddrinfo" not in undefined
    defined = output_of("nm", "-D", "--defined-only", MODULE)
    # One for Python, and one for onnxruntime.
    assert [line.split()[-1] for line in defined.splitlines() if " T " in line] == ["PyInit__core", "RegisterCustomOps"]


def test_the_module_does_not_tell_where_it_was_built() -> None:
    content = MODULE.read_bytes()
    for path in (ROOT, Path.home()):
        assert str(path).encode() not in content
