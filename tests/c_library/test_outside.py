"""The C library as an outside project meets it: installed, found by CMake and pkg-config, linked, run."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import endosdk
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL, shifted_pair


def write_ppm(path: Path, picture: np.ndarray) -> None:
    path.write_bytes(b"P6\n# a comment\n%d %d\n255\n" % picture.shape[1::-1] + picture.tobytes())


def read_pgm16(path: Path) -> np.ndarray:
    _, size, most, pixels = path.read_bytes().split(b"\n", 3)
    assert most == b"65535"
    width, height = map(int, size.split())
    return np.frombuffer(pixels, ">u2").reshape(height, width)


def write_pair(folder: Path, height: int, width: int, disparity: int) -> tuple[np.ndarray, np.ndarray]:
    """Write left.ppm and right.ppm, and return the two."""
    pair = shifted_pair(height, width, disparity)
    for name, view in zip(("left.ppm", "right.ppm"), pair, strict=True):
        write_ppm(folder / name, view)
    return pair


def test_depth_cli_gives_pythons_depth(examples, environment, tmp_path):
    left, right = write_pair(tmp_path, 120, 200, 7)
    files = [str(tmp_path / name) for name in ("left.ppm", "right.ppm", "depth.pgm")]
    command = [str(examples / "depth_cli"), str(TINY_MODEL), *files, "210", "4.5"]
    subprocess.run(command, check=True, env=environment, capture_output=True)
    rig = endosdk.StereoCalibration.rectified(210.0, 4.5, (200, 120))
    expected = endosdk.DepthEstimator(TINY_MODEL, calibration=rig).predict(left, right).depth
    depth = read_pgm16(tmp_path / "depth.pgm")
    np.testing.assert_array_equal(depth == 0, np.isnan(expected))
    assert np.nanmax(np.abs(0.1 * depth - expected)[depth > 0]) < 0.06


def test_depth_cli_answers_nothing_for_a_pair_that_must_not_be_used(examples, environment, tmp_path):
    write_ppm(tmp_path / "view.ppm", shifted_pair(120, 200, 7)[0])
    command = [
        str(examples / "depth_cli"),
        str(TINY_MODEL),
        *[str(tmp_path / "view.ppm")] * 2,
        str(tmp_path / "out.pgm"),
    ]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "must not be used" in done.stderr
    assert not read_pgm16(tmp_path / "out.pgm").any()


def test_the_examples_pin_the_model_where_asked(examples, environment):
    pinned = {**environment, "MODEL_SHA256": 64 * "0"}
    command = [str(examples / "live"), str(TINY_MODEL), "96", "64"]
    done = subprocess.run(command, env=pinned, input=b"", capture_output=True, check=False)
    assert done.returncode == 1
    assert b"MODEL_HASH_MISMATCH" in done.stderr or b"must have SHA-256" in done.stderr


def test_depth_cli_says_what_is_wrong(examples, environment, tmp_path):
    (tmp_path / "left.ppm").write_bytes(b"P3 no")
    command = [str(examples / "depth_cli"), str(TINY_MODEL), *[str(tmp_path / "left.ppm")] * 2, "out.pgm"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "P5 or P6" in done.stderr


def test_live_answers_every_frame_or_says_it_skipped(examples, environment):
    left, right = shifted_pair(64, 96, 7)
    command = [str(examples / "live"), str(TINY_MODEL), "96", "64", "1000"]
    frames = 40 * (left.tobytes() + right.tobytes())
    done = subprocess.run(command, input=frames, env=environment, capture_output=True, check=True)
    found = re.search(rb"(\d+) frames computed, 0 of them invalid, (\d+) skipped, 0 late", done.stdout)
    assert found is not None, done.stdout
    assert int(found[1]) >= 1
    assert int(found[1]) + int(found[2]) == 40
    assert b"p99" in done.stdout
    assert done.stderr == b""


def test_live_says_when_the_camera_stalls(examples, environment):
    left, right = shifted_pair(64, 96, 7)
    frame = left.tobytes() + right.tobytes()
    command = [str(examples / "live"), str(TINY_MODEL), "96", "64", "1000"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, env=environment, **pipes) as program:
        program.stdin.write(4 * frame)  # more than a pipe holds: written once the program reads frames
        program.stdin.flush()
        time.sleep(1.5)
        found, said = program.communicate(frame)
    assert said == b"live: no frame for 1 s\n"
    assert program.returncode == 0
    computed, skipped = map(int, re.search(rb"(\d+) frames computed, 0 of them invalid, (\d+) skipped", found).groups())
    assert computed + skipped == 5
    assert computed >= 2  # the one before the pause and the one after it


def test_the_headers_own_program_runs(installed, environment, tmp_path):
    """The program that opens endosdk.h, found by pkg-config, built by a C compiler that knows no CMake."""
    comment = c.HEADER.read_text().split("*/")[0]
    lines = comment.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("    #include"))
    last = next(i for i, line in enumerate(lines) if line == "    }")
    (tmp_path / "program.c").write_text("\n".join(line[4:] for line in lines[first : last + 1]) + "\n")
    shutil.copy(TINY_MODEL, tmp_path / "fast.onnx")
    flags = pkg_config(installed.prefix, environment)
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-Wl,-rpath,{installed.library.parent}"]
    subprocess.run(["cc", *strict, "program.c", "-o", "program", *flags], cwd=tmp_path, check=True)
    left, right = shifted_pair(720, 960, 9)
    done = subprocess.run(
        ["./program"],
        input=left.tobytes() + right.tobytes(),
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        check=True,
    )
    assert re.fullmatch(rb"frame 1: (8\.\d|9\.\d) px in the middle\n", done.stdout), done.stdout


def pkg_config(prefix: Path, environment: dict[str, str]) -> list[str]:
    """Flags to compile and link with the library installed there; skip where no compiler could use them."""
    if shutil.which("pkg-config") is None or shutil.which("cc") is None:
        pytest.skip("no pkg-config or no C compiler (Debian: apt-get install pkg-config gcc)")
    folder = next(prefix.glob("lib*/**/endosdk.pc")).parent
    done = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "endosdk"],
        env={**environment, "PKG_CONFIG_PATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


OLD_RUNTIME = """
#include <stdint.h>
#include <stdio.h>
static const void *api(uint32_t version) { return version > 20 ? 0 : ""; }
static const char *name(void) { return "1.20.1"; }
static const struct { const void *(*api)(uint32_t); const char *(*name)(void); } base = {api, name};
const void *OrtGetApiBase(void) { return &base; }
__attribute__((constructor)) static void opened(void) { fprintf(stderr, "old runtime opened\\n"); }
"""


def compile_old_runtime(place: Path) -> None:
    """Put a library there that is an ONNX Runtime of a version that is too old."""
    soname = "-Wl,-soname,libonnxruntime.so.1"
    command = ["cc", "-shared", "-fPIC", soname, "-x", "c", "-", "-o", str(place)]
    subprocess.run(command, input=OLD_RUNTIME, text=True, check=True)


@pytest.mark.parametrize("place", ["variable", "beside the library", "beside one in acme[2]", "active environment"])
def test_the_runtime_is_found_where_the_page_says(examples, installed, tmp_path, place):
    write_pair(tmp_path, 48, 64, 5)
    runtime = c.runtime_library()
    known = {"ENDOSDK_ORT_LIBRARY", "VIRTUAL_ENV"}
    variables = {name: value for name, value in os.environ.items() if name not in known}
    beside = installed.library.parent / runtime.name
    if place == "variable":
        variables["ENDOSDK_ORT_LIBRARY"] = str(runtime)
    elif place == "active environment":
        packages = tmp_path / "venv" / "lib" / "python3.11" / "site-packages"
        packages.mkdir(parents=True)
        (packages / "onnxruntime").symlink_to(runtime.parents[1])
        variables["VIRTUAL_ENV"] = str(tmp_path / "venv")
    elif place == "beside the library":
        beside.symlink_to(runtime)
    else:
        folder = tmp_path / "acme[2]"
        folder.mkdir()
        shutil.copy(installed.library, folder)
        (folder / runtime.name).symlink_to(runtime)
        variables["LD_LIBRARY_PATH"] = str(folder)
    files = [str(tmp_path / name) for name in ("left.ppm", "right.ppm", "depth.pgm")]
    try:
        subprocess.run([examples / "depth_cli", TINY_MODEL, *files], env=variables, check=True, capture_output=True)
    finally:
        beside.unlink(missing_ok=True)


@pytest.mark.parametrize("place", ["active environment", "system"])
def test_a_runtime_that_is_too_old_does_not_end_the_search(examples, installed, tmp_path, place):
    """One lies beside the library, under the name that the loader knows the right one by."""
    write_pair(tmp_path, 48, 64, 5)
    known = {"ENDOSDK_ORT_LIBRARY", "VIRTUAL_ENV"}
    variables = {name: value for name, value in os.environ.items() if name not in known}
    if place == "active environment":
        variables["VIRTUAL_ENV"] = sys.prefix
    else:
        (tmp_path / "libonnxruntime.so.1").symlink_to(c.runtime_library())
        variables["LD_LIBRARY_PATH"] = str(tmp_path)
    beside = installed.library.parent / "libonnxruntime.so.1"
    compile_old_runtime(beside)
    files = [str(tmp_path / name) for name in ("left.ppm", "right.ppm", "depth.pgm")]
    try:
        subprocess.run([examples / "depth_cli", TINY_MODEL, *files], env=variables, check=True, capture_output=True)
    finally:
        beside.unlink()


def test_a_runtime_that_was_named_is_not_replaced_by_another(examples, installed, tmp_path):
    write_ppm(tmp_path / "view.ppm", shifted_pair(48, 64, 5)[0])
    variables = {**os.environ, "ENDOSDK_ORT_LIBRARY": "/no/such/library.so", "VIRTUAL_ENV": sys.prefix}
    files = [str(tmp_path / "view.ppm")] * 2 + [str(tmp_path / "depth.pgm")]
    done = subprocess.run(
        [examples / "depth_cli", TINY_MODEL, *files], env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "/no/such/library.so" in done.stderr and "RUNTIME_MISSING" in done.stderr


C_ONLY = """
cmake_minimum_required(VERSION 3.21)
project(device LANGUAGES C)
find_package(endosdk 0.1 CONFIG REQUIRED)
add_executable(depth_cli depth_cli.c)
target_link_libraries(depth_cli PRIVATE endosdk::endosdk)
"""


@pytest.fixture(scope="module")
def static_prefix(sanitized, tmp_path_factory) -> Path:
    """An installation of the static library."""
    prefix = tmp_path_factory.mktemp("static")
    c.cmake("--install", sanitized, "--prefix", prefix)
    return prefix


@pytest.fixture(scope="module")
def static_program(static_prefix, tmp_path_factory) -> Path:
    """A program with the library inside, built by a project that knows C alone."""
    folder = tmp_path_factory.mktemp("device")
    (folder / "CMakeLists.txt").write_text(C_ONLY)
    shutil.copy(c.ROOT / "cpp" / "examples" / "depth_cli.c", folder)
    c.cmake("-S", folder, "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={static_prefix}")
    c.cmake("--build", folder / "build")
    return folder / "build" / "depth_cli"


def assert_gives_a_map(program: Path, environment: dict[str, str], folder: Path) -> None:
    write_pair(folder, 48, 64, 5)
    files = [folder / name for name in ("left.ppm", "right.ppm", "disparity.pgm")]
    subprocess.run([program, TINY_MODEL, *files], env=environment, check=True, capture_output=True)
    assert read_pgm16(folder / "disparity.pgm").shape == (48, 64)


def test_a_static_library_links_into_a_project_of_c(static_program, environment, tmp_path):
    assert_gives_a_map(static_program, environment, tmp_path)


def test_a_static_library_links_into_a_project_of_c_and_cpp(static_prefix, environment, tmp_path):
    source = c.ROOT / "cpp" / "examples"
    c.cmake("-S", source, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={static_prefix}")
    c.cmake("--build", tmp_path / "build")
    assert_gives_a_map(tmp_path / "build" / "depth_cli", environment, tmp_path)


def test_a_static_library_is_found_by_pkg_config(static_prefix, environment, tmp_path):
    flags = [*pkg_config(static_prefix, environment), "-fsanitize=address,undefined"]
    source = c.ROOT / "cpp" / "examples" / "depth_cli.c"
    subprocess.run(["cc", "-std=c11", source, "-o", tmp_path / "depth_cli", *flags], check=True)
    assert_gives_a_map(tmp_path / "depth_cli", environment, tmp_path)


@pytest.mark.parametrize("name", ["{foreign}/depth_cli", "./depth_cli", "depth_cli"])
def test_the_name_a_program_is_started_by_decides_nothing(static_program, tmp_path, name):
    """With the library inside, "beside the library" is beside the program, whatever its caller calls it."""
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    compile_old_runtime(foreign / "libonnxruntime.so")
    write_pair(foreign, 48, 64, 5)
    known = {"ENDOSDK_ORT_LIBRARY", "VIRTUAL_ENV", "LD_LIBRARY_PATH"}
    variables = {key: value for key, value in os.environ.items() if key not in known}
    command = [name.format(foreign=foreign), str(TINY_MODEL), "left.ppm", "right.ppm", "disparity.pgm"]
    beside = static_program.parent / "libonnxruntime.so"
    beside.symlink_to(c.runtime_library())
    try:
        done = subprocess.run(
            command,
            executable=static_program,
            cwd=foreign,
            env=variables,
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        beside.unlink()
    assert done.returncode == 0, done.stderr
    assert "old runtime opened" not in done.stderr
