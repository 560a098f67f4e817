"""The C library as the tests meet it: built and installed once, loaded, and its examples built from outside."""

from __future__ import annotations

import ctypes
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.c_library import binding as c
from tests.conftest import ROOT


@dataclass(frozen=True)
class Installed:
    """A build of the library and where it was installed."""

    build: Path
    prefix: Path

    @property
    def library(self) -> Path:
        return next(self.prefix.glob("lib*/**/libendosdk.so.0"))


@pytest.fixture(scope="session")
def installed(tmp_path_factory) -> Installed:
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DENDOSDK_BUILD_TESTS=ON", "-DENDOSDK_BUILD_EXAMPLES=ON"]
    c.build(c.BUILD, *options)
    prefix = tmp_path_factory.mktemp("sdk")
    c.cmake("--install", c.BUILD, "--prefix", prefix)
    return Installed(c.BUILD, prefix)


@pytest.fixture(scope="session")
def library(installed) -> ctypes.CDLL:
    return c.load(installed.library)


# Test programs and fuzzers that run under sanitizers.
PARTS = ("frames", "maps", "models", "operation", "refusals", "session_threads", "streams", "thread_hook", "units")
SANITIZED = (
    *(f"library_{part}" for part in PARTS),
    *(f"fuzz_{part}" for part in ("calibration", "frame", "model", "rig_file")),
)


@pytest.fixture(scope="session")
def sanitized() -> Path:
    """A build with checks of memory and undefined behaviour; linked as a static library, the other way to ship it."""
    folder = ROOT / "build" / "c-library-sanitized"
    c.build(
        folder,
        "-DCMAKE_BUILD_TYPE=None",
        "-DCMAKE_CXX_FLAGS=-O0 -g1",
        "-DENDOSDK_SANITIZE=address,undefined",
        "-DENDOSDK_PRECOMPILE=ON",  # no other build has these flags: a compiler cache finds nothing
        "-DENDOSDK_BUILD_TESTS=ON",
        "-DENDOSDK_BUILD_FUZZERS=ON",
        "-DBUILD_SHARED_LIBS=OFF",
        targets=("endosdk", *SANITIZED),
    )
    return folder


@pytest.fixture(scope="session")
def examples(installed, tmp_path_factory) -> Path:
    """The example programs, built by a project that only knows where the library is installed."""
    folder = tmp_path_factory.mktemp("outside")
    shutil.copytree(ROOT / "cpp" / "examples", folder / "source")
    c.cmake("-S", folder / "source", "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={installed.prefix}")
    c.cmake("--build", folder / "build")
    return folder / "build"


@pytest.fixture
def environment() -> dict[str, str]:
    """Variables of a program that finds the runtime by the one that the page names."""
    return {**os.environ, "ENDOSDK_ORT_LIBRARY": str(c.runtime_library())}
