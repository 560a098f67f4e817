"""The C library against the Python package, and as vendors meet it: installed, linked, inspected, watched."""

from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import endosdk
from endosdk.errors import ErrorCode
from tests import c_library as c
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.rigs import fisheye_rig, raw_rig

HEADER = ROOT / "cpp" / "include" / "endosdk" / "endosdk.h"
ABI = ROOT / "cpp" / "abi" / "libendosdk-0.1.0.abi"
RIGS = {
    "no rig": lambda: None,
    "raw": raw_rig,
    "fisheye": fisheye_rig,
    "rectified": lambda: endosdk.StereoCalibration.rectified(520.0, 4.5, (640, 480), doffs=3.5),
}


@dataclass(frozen=True)
class Installed:
    """A build of the library and where it was installed."""

    build: Path
    prefix: Path

    @property
    def library(self) -> Path:
        return next(self.prefix.glob("lib*/**/libendosdk.so.0"))


def build(folder: Path, *options: str) -> None:
    c.configure(folder, f"-DENDOSDK_TEST_RUNTIME={c.runtime_library()}", *options)
    c.cmake("--build", folder, "--parallel")


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Installed:
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DENDOSDK_BUILD_TESTS=ON", "-DENDOSDK_BUILD_EXAMPLES=ON"]
    build(c.BUILD, *options)
    prefix = tmp_path_factory.mktemp("sdk")
    c.cmake("--install", c.BUILD, "--prefix", prefix)
    return Installed(c.BUILD, prefix)


@pytest.fixture(scope="module")
def library(installed) -> ctypes.CDLL:
    return c.load(installed.library)


def run_tests(folder: Path, pattern: str) -> None:
    done = subprocess.run(
        ["ctest", "--test-dir", str(folder), "--output-on-failure", "--no-tests=error", "-R", pattern],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:]


# ---- the same answers ----


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize(
    ("size", "network_size"), [((640, 480), None), ((640, 480), (320, 200)), ((331, 245), None)], ids=str
)
def test_same_maps_as_python(library, rig_name, size, network_size):
    rig = RIGS[rig_name]()
    if rig is not None and size != (rig.width, rig.height):
        rig = rig.scaled(*size)
    left, right = shifted_pair(size[1], size[0], 11)
    left[40:60, 50:90] = 255  # glare
    python = endosdk.DepthEstimator(TINY_MODEL, calibration=rig, network_size=network_size)
    expected = python.predict(left, right)
    width, height = network_size or (0, 0)
    estimator = c.CEstimator(library, TINY_MODEL, rig, network_width=width, network_height=height)
    names = tuple(c.MAPS) if rig else ("disparity", "confidence", "reasons", "disparity_u16")
    result, maps = estimator.predict(left, right, maps=names)
    estimator.close()
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=1e-4)
    np.testing.assert_allclose(maps["confidence"], expected.confidence, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(maps["reasons"], expected.reasons)
    assert (maps["reasons"] & endosdk.Reason.SATURATED).any()
    assert result.valid_share == expected.valid_share
    assert result.quality == expected.status
    answered = expected.reasons == 0
    steps = np.where(answered, np.clip(np.round(256 * expected.disparity), 0, 65535), 0)
    assert np.abs(maps["disparity_u16"] - steps).max() <= 1
    if rig is None:
        return
    np.testing.assert_allclose(maps["depth"], expected.depth, rtol=1e-6)
    np.testing.assert_allclose(maps["sigma"], expected.sigma, rtol=1e-6)
    tenths = np.where(answered, np.clip(10 * np.nan_to_num(expected.depth), 0, 65535), 0)
    assert np.abs(maps["depth_u16"] - tenths).max() <= 0.51 + 1e-6 * 65535


@pytest.mark.parametrize("order", ["bgr", "gray"])
def test_same_maps_for_other_pixels(library, order):
    left, right = shifted_pair(120, 200, 7)
    if order == "gray":
        left, right = (np.ascontiguousarray(view[:, :, 1]) for view in (left, right))
    channel_order = "rgb" if order == "gray" else order
    expected = endosdk.DepthEstimator(TINY_MODEL, channel_order=channel_order).predict(left, right)
    estimator = c.CEstimator(library, TINY_MODEL)
    _, maps = estimator.predict(left, right, channel_order, maps=("disparity", "reasons"))
    estimator.close()
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(maps["reasons"], expected.reasons)


@pytest.mark.parametrize(("disparity", "network_size"), [(31, (0, 0)), (62, (120, 60))], ids=str)
def test_same_end_of_the_range_as_python(library, disparity, network_size):
    left, right = shifted_pair(120, 240, disparity)
    python = endosdk.DepthEstimator(TINY_MODEL, network_size=network_size if any(network_size) else None)
    expected = python.predict(left, right).reasons
    width, height = network_size
    estimator = c.CEstimator(library, TINY_MODEL, network_width=width, network_height=height)
    _, maps = estimator.predict(left, right, maps=("reasons",))
    estimator.close()
    np.testing.assert_array_equal(maps["reasons"], expected)
    assert np.mean((expected & endosdk.Reason.OUT_OF_RANGE) != 0) > 0.4


@pytest.mark.parametrize("rig_name", [name for name in RIGS if name != "no rig"])
def test_same_geometry_and_hash_as_python(library, rig_name):
    rig = RIGS[rig_name]()
    expected = rig.rectification()
    estimator = c.CEstimator(library, TINY_MODEL, rig)
    geometry = estimator.geometry()
    report = json.loads(estimator.diagnostics())
    estimator.close()
    assert bool(geometry.rectifies) is not rig.is_rectified
    for name in ("focal_px", "baseline_mm", "cx", "cy", "doffs"):
        assert getattr(geometry, name) == pytest.approx(getattr(expected, name), rel=1e-9, abs=1e-9), name
    assert report["calibration_sha256"] == rig.sha256
    assert report["model"]["sha256"] == endosdk.DepthEstimator(TINY_MODEL).model.sha256
    assert report["onnxruntime_telemetry"] == "off"


# ---- errors ----


def edited_model(change) -> bytes:
    onnx = pytest.importorskip("onnx")
    model = onnx.load(TINY_MODEL)
    change(onnx, model)
    return model.SerializeToString()


def drop_metadata(onnx, model):
    del model.metadata_props[:]


def claim(key, value):
    def change(onnx, model):
        next(p for p in model.metadata_props if p.key == f"endosdk.{key}").value = value

    return change


def rename_input(onnx, model):
    for node in model.graph.node:
        node.input[:] = ["links" if name == "left" else name for name in node.input]
    next(i for i in model.graph.input if i.name == "left").name = "links"


def double_disparity(onnx, model):
    for node in model.graph.node:
        node.output[:] = ["half" if name == "disparity" else name for name in node.output]
        node.input[:] = ["half" if name == "disparity" else name for name in node.input]
    model.graph.node.append(onnx.helper.make_node("Add", ["half", "half"], ["disparity"]))


@pytest.mark.parametrize(
    "change",
    [
        drop_metadata,
        claim("format_version", "2"),
        claim("channel_order", "bgr"),
        claim("training", "{not json"),
        claim("input_multiple", "0"),
        claim("output_stride", "-4"),
        claim("max_disparity", "many"),
        claim("last_plane", "33"),
        claim("name", ""),
        rename_input,
    ],
    ids=lambda change: change.__name__,
)
def test_bad_models_are_refused_as_in_python(library, change):
    model = edited_model(change)
    with pytest.raises(endosdk.EndoError) as python:
        endosdk.DepthEstimator(model)
    with pytest.raises(c.CError) as seen:
        c.CEstimator(library, model)
    assert seen.value.name == python.value.code.name == "MODEL_METADATA"


def test_self_test_finds_a_wrong_answer(library):
    estimator = c.CEstimator(library, edited_model(double_disparity))
    with pytest.raises(c.CError, match="half of a plane") as seen:
        estimator.self_test()
    estimator.close()
    assert seen.value.name == "SELF_TEST_FAILED"


def test_status_numbers_are_pythons():
    numbers = dict(re.findall(r"^    ENDO_([A-Z_]+) = (\d+)[,\s]", HEADER.read_text().split("endo_status;")[0], re.M))
    assert len(numbers) == 16
    assert {name: int(number) for name, number in numbers.items()}.items() <= ErrorCode.__members__.items()


# ---- programs ----


def test_programs(installed):
    run_tests(installed.build, "^library")


def test_under_sanitizers():
    """Memory errors, leaks and undefined behaviour; linked as a static library, the other way to ship it."""
    folder = ROOT / "build" / "c-library-sanitized"
    build(
        folder,
        "-DCMAKE_BUILD_TYPE=None",
        "-DCMAKE_CXX_FLAGS=-O1 -g1",
        "-DENDOSDK_SANITIZE=address,undefined",
        "-DENDOSDK_BUILD_TESTS=ON",
        "-DENDOSDK_BUILD_FUZZERS=ON",
        "-DBUILD_SHARED_LIBS=OFF",
    )
    run_tests(folder, "^(library_(maps|models|operation|refusals|units)|fuzz_.*)$")


# ---- as an outside project meets it ----


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "ENDOSDK_ORT_LIBRARY": str(c.runtime_library()), **more}


@pytest.fixture(scope="module")
def examples(installed, tmp_path_factory) -> Path:
    """The example programs, built by a project that only knows where the library is installed."""
    folder = tmp_path_factory.mktemp("outside")
    shutil.copytree(ROOT / "cpp" / "examples", folder / "source")
    c.cmake("-S", folder / "source", "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={installed.prefix}")
    c.cmake("--build", folder / "build")
    return folder / "build"


def write_ppm(path: Path, picture: np.ndarray) -> None:
    path.write_bytes(b"P6\n# a comment\n%d %d\n255\n" % picture.shape[1::-1] + picture.tobytes())


def read_pgm16(path: Path) -> np.ndarray:
    _, size, most, pixels = path.read_bytes().split(b"\n", 3)
    assert most == b"65535"
    width, height = map(int, size.split())
    return np.frombuffer(pixels, ">u2").reshape(height, width)


def test_depth_cli_gives_pythons_depth(examples, tmp_path):
    left, right = shifted_pair(120, 200, 7)
    write_ppm(tmp_path / "left.ppm", left)
    write_ppm(tmp_path / "right.ppm", right)
    files = [str(tmp_path / name) for name in ("left.ppm", "right.ppm", "depth.pgm")]
    command = [str(examples / "depth_cli"), str(TINY_MODEL), *files, "210", "4.5"]
    subprocess.run(command, check=True, env=environment(), capture_output=True)
    rig = endosdk.StereoCalibration.rectified(210.0, 4.5, (200, 120))
    expected = endosdk.DepthEstimator(TINY_MODEL, calibration=rig).predict(left, right).depth
    depth = read_pgm16(tmp_path / "depth.pgm")
    np.testing.assert_array_equal(depth == 0, np.isnan(expected))
    assert np.nanmax(np.abs(0.1 * depth - expected)[depth > 0]) < 0.06


def test_depth_cli_says_what_is_wrong(examples, tmp_path):
    (tmp_path / "left.ppm").write_bytes(b"P3 no")
    command = [str(examples / "depth_cli"), str(TINY_MODEL), *[str(tmp_path / "left.ppm")] * 2, "out.pgm"]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "P5 or P6" in done.stderr


def test_live_answers_every_frame_or_says_it_skipped(examples):
    left, right = shifted_pair(64, 96, 7)
    command = [str(examples / "live"), str(TINY_MODEL), "96", "64", "1000"]
    frames = 40 * (left.tobytes() + right.tobytes())
    done = subprocess.run(command, input=frames, env=environment(), capture_output=True, check=True)
    found = re.search(rb"(\d+) frames computed, (\d+) skipped, 0 late", done.stdout)
    assert found is not None, done.stdout
    assert int(found[1]) >= 1
    assert int(found[1]) + int(found[2]) == 40
    assert b"p99" in done.stdout


def test_the_headers_own_program_runs(installed, tmp_path):
    """The program that opens endosdk.h, found by pkg-config, built by a C compiler that knows no CMake."""
    if shutil.which("pkg-config") is None or shutil.which("cc") is None:
        pytest.skip("no pkg-config or no C compiler")
    comment = HEADER.read_text().split("*/")[0]
    lines = comment.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("    #include"))
    last = next(i for i, line in enumerate(lines) if line == "    }")
    (tmp_path / "program.c").write_text("\n".join(line[4:] for line in lines[first : last + 1]) + "\n")
    shutil.copy(TINY_MODEL, tmp_path / "wang2020.onnx")
    found = next(installed.prefix.glob("lib*/**/endosdk.pc")).parent
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "endosdk"],
        env=environment(PKG_CONFIG_PATH=str(found)),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    strict = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-Wl,-rpath,{installed.library.parent}"]
    subprocess.run(["cc", *strict, "program.c", "-o", "program", *flags], cwd=tmp_path, check=True)
    left, right = shifted_pair(720, 960, 9)
    done = subprocess.run(
        ["./program"],
        input=left.tobytes() + right.tobytes(),
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        check=True,
    )
    assert re.fullmatch(rb"frame 1: (8\.\d|9\.\d) px in the middle\n", done.stdout), done.stdout


@pytest.mark.parametrize("place", ["variable", "beside the library", "active environment"])
def test_the_runtime_is_found_where_the_page_says(examples, installed, tmp_path, place):
    left, right = shifted_pair(48, 64, 5)
    write_ppm(tmp_path / "left.ppm", left)
    write_ppm(tmp_path / "right.ppm", right)
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
    else:
        beside.symlink_to(runtime)
    files = [str(tmp_path / name) for name in ("left.ppm", "right.ppm", "depth.pgm")]
    try:
        subprocess.run([examples / "depth_cli", TINY_MODEL, *files], env=variables, check=True, capture_output=True)
    finally:
        beside.unlink(missing_ok=True)


def test_a_runtime_that_was_named_is_not_replaced_by_another(examples, installed, tmp_path):
    write_ppm(tmp_path / "view.ppm", shifted_pair(48, 64, 5)[0])
    variables = environment(ENDOSDK_ORT_LIBRARY="/no/such/library.so", VIRTUAL_ENV=sys.prefix)
    files = [str(tmp_path / "view.ppm")] * 2 + [str(tmp_path / "depth.pgm")]
    done = subprocess.run(
        [examples / "depth_cli", TINY_MODEL, *files], env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "/no/such/library.so" in done.stderr and "RUNTIME_MISSING" in done.stderr


# ---- the binary ----


def output_of(*command: str | Path) -> str:
    if shutil.which(str(command[0])) is None:
        pytest.skip(f"no {command[0]}")
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True).stdout


def declared_functions() -> set[str]:
    return set(re.findall(r"^ENDO_API [^;]*?\b(endo_\w+)\(", HEADER.read_text(), re.M))


def test_exports_are_the_header_and_nothing_else(installed):
    symbols = output_of("nm", "-D", "--defined-only", "--with-symbol-versions", installed.library)
    functions = {line.split()[-1] for line in symbols.splitlines() if " T " in line}
    assert functions == {f"{name}@@ENDOSDK_0.1" for name in declared_functions()}
    assert not [line for line in symbols.splitlines() if re.search(r" [VWDB] ", line)]
    assert len(functions) <= 20
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
    assert "socket" not in symbols and "getaddrinfo" not in symbols


def test_the_binary_does_not_tell_where_it_was_built(installed):
    content = installed.library.read_bytes()
    for path in (ROOT, c.BUILD, Path.home()):
        assert str(path).encode() not in content


def test_the_abi_is_that_of_the_first_release(installed):
    if shutil.which("abidiff") is None:
        pytest.skip("abidiff is not installed (Debian: abigail-tools)")
    options = ["--no-show-locs", "--exported-interfaces-only", "--no-added-syms", "--headers-dir2", str(HEADER.parent)]
    done = subprocess.run(
        ["abidiff", *options, str(ABI), str(installed.library)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


# ---- silence ----


@pytest.fixture(scope="module")
def watcher(tmp_path_factory) -> Iterator[Path]:
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    library = tmp_path_factory.mktemp("watch") / "watch_network.so"
    source = ROOT / "tests" / "data" / "watch_network.c"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    yield library


def test_a_thousand_frames_reach_nobody_and_leave_nothing(installed, watcher, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    log = tmp_path / "network.log"
    program = next(installed.build.rglob("library_steadiness"))
    # The runtime keeps its reporter off by itself on CI machines, so the proof must run without their variables.
    silent = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY")
    plain = {name: value for name, value in os.environ.items() if name not in silent}
    plain |= {"LD_PRELOAD": str(watcher), "WATCH_NETWORK_LOG": str(log), "HOME": str(home), "XDG_CACHE_HOME": str(home)}
    subprocess.run([program, c.runtime_library(), TINY_MODEL, "1000"], env=plain, check=True, capture_output=True)
    assert not log.exists()
    assert list(home.rglob("*")) == []
    # The watcher does see: a program that asks for a host is noted.
    talk = "import socket\ntry: socket.getaddrinfo('example.invalid', 80)\nexcept OSError: pass"
    subprocess.run([sys.executable, "-c", talk], env=plain, check=True)
    assert "example.invalid" in log.read_text()
