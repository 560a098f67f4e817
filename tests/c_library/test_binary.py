"""What is in the binary and what it does behind the caller's back: exports, hardening, paths, ABI, network."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL

ABI = ROOT / "cpp" / "abi" / "libendosdk-0.1.0.abi"


def output_of(*command: str | Path) -> str:
    if shutil.which(str(command[0])) is None:
        pytest.skip(f"no {command[0]} (Debian: apt-get install binutils)")
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True).stdout


def declared_functions() -> set[str]:
    return set(re.findall(r"^ENDO_API [^;]*?\b(endo_\w+)\(", c.HEADER.read_text(), re.M))


def test_exports_are_the_header_and_nothing_else(installed):
    symbols = output_of("nm", "-D", "--defined-only", "--with-symbol-versions", installed.library)
    functions = {line.split()[-1] for line in symbols.splitlines() if " T " in line}
    assert functions == {f"{name}@@ENDOSDK_0.1" for name in declared_functions()}
    assert not [line for line in symbols.splitlines() if re.search(r" [VWDB] ", line)]
    assert len(functions) <= 40
    assert declared_functions() == set(c.SIGNATURES)


def test_the_binary_is_hardened_and_needs_only_the_system(installed):
    headers = output_of("readelf", "--wide", "--program-headers", "--dynamic", installed.library)
    assert "GNU_RELRO" in headers
    assert re.search(r"GNU_STACK.* RW ", headers)
    assert re.search(r"\(FLAGS\).*BIND_NOW|\(FLAGS_1\).*NOW", headers)
    assert "RPATH" not in headers and "RUNPATH" not in headers
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", headers))
    assert needed <= {"libstdc++.so.6", "libm.so.6", "libgcc_s.so.1", "libc.so.6", "ld-linux-x86-64.so.2"}
    assert re.search(r"\(SONAME\).*\[libendosdk\.so\.0\]", headers)
    symbols = output_of("nm", "-D", "--undefined-only", installed.library)
    assert "__stack_chk_fail" in symbols
    assert "__memcpy_chk" in symbols  # fortified
    assert "socket" not in symbols and "getaddrinfo" not in symbols


def test_the_binary_does_not_tell_where_it_was_built(installed):
    content = installed.library.read_bytes()
    for path in (ROOT, c.BUILD, Path.home()):
        assert str(path).encode() not in content


def test_no_object_tells_where_the_headers_of_the_runtime_were(installed, tmp_path):
    """They may lie anywhere; what a debugger would be told of them ends up in the installed library."""
    headers = tmp_path / "headers"
    cache = (installed.build / "CMakeCache.txt").read_text()
    found = re.search(r"^ONNXRUNTIME_INCLUDE_DIR:\w+=(.*)$", cache, re.M)
    assert found is not None
    shutil.copytree(found[1], headers)
    build = tmp_path / "build"
    options = ("-DCMAKE_BUILD_TYPE=Release", "-DENDOSDK_BUILD_TESTS=ON", "-DENDOSDK_TEST_RUNTIME=")
    c.configure(build, *options, f"-DONNXRUNTIME_INCLUDE_DIR={headers}")
    checked = {"capi.cpp", "runtime.cpp"}
    entries = [
        entry
        for entry in json.loads((build / "compile_commands.json").read_text())
        if Path(entry["file"]).name in checked
    ]
    assert {Path(entry["file"]).name for entry in entries} == checked
    for entry in entries:
        words = shlex.split(entry["command"])
        made = Path(entry["directory"]) / words[words.index("-o") + 1]
        made.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(entry["command"], shell=True, cwd=entry["directory"], check=True)
        assert str(tmp_path).encode() not in made.read_bytes()


def test_the_abi_is_that_of_the_first_release(installed):
    if shutil.which("abidiff") is None:
        pytest.skip("no abidiff (Debian: apt-get install abigail-tools)")
    options = ["--no-show-locs", "--exported-interfaces-only", "--no-added-syms", "--headers-dir2", c.HEADER.parent]
    done = subprocess.run(["abidiff", *options, ABI, installed.library], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


# The runtime's own reporter would look up its host about 9 s after the library is opened.
@pytest.mark.parametrize("seconds", [0, 20])
def test_a_thousand_frames_reach_nobody_and_leave_nothing(installed, watcher, tmp_path, seconds):
    home = tmp_path / "home"
    home.mkdir()
    log = tmp_path / "network.log"
    program = next(installed.build.rglob("library_steadiness"))
    # The runtime keeps its reporter off by itself on CI machines, so the proof must run without their variables.
    silent = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")
    plain = {name: value for name, value in os.environ.items() if name not in silent}
    plain |= {"LD_PRELOAD": str(watcher), "WATCH_NETWORK_LOG": str(log), "HOME": str(home), "XDG_CACHE_HOME": str(home)}
    command = [program, c.runtime_library(), TINY_MODEL, "1000", str(seconds)]
    subprocess.run(command, env=plain, check=True, capture_output=True)
    assert not log.exists()
    assert list(home.rglob("*")) == []
    # The watcher does see: a program that asks for a host is noted.
    talk = "import socket\ntry: socket.getaddrinfo('example.invalid', 80)\nexcept OSError: pass"
    subprocess.run([sys.executable, "-c", talk], env=plain, check=True)
    assert "example.invalid" in log.read_text()
