"""The long checks of the C library: many frames, overhead, sanitizers, fuzzing. Minutes to an hour.

    python -m benchmarks.speed.c_library --json FILE [--only steadiness overhead streams sanitizers fuzz]

A part that is not run keeps what the file says of it. Every part carries the machine and commit it was run on.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import deque
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.model_run import model_run
from benchmarks.record import Hashes, write_part
from endosdk import DepthEstimator
from endosdk.datasets.samples import sample_pairs
from endosdk.runtime.models import shipped_models
from tests.c_library import binding

ROOT = Path(__file__).resolve().parents[2]
TINY_MODEL = ROOT / "models" / "tiny-for-tests.onnx"
TIMED = (  # model, width, height, frames
    (TINY_MODEL, 640, 480, 60),
    (ROOT / "models" / "fast.onnx", 960, 720, 200),
    (ROOT / "models" / "wang2020.onnx", 960, 720, 6),
)
STREAMED = ("fast", "fast-320")
STREAM_SIZES = ((960, 720), (1920, 1080))
STREAM_FRAMES, STREAM_TURNS = 100, 5
# The longest input of each, bytes.
FUZZERS = {"model": 16384, "calibration": ctypes.sizeof(binding.Calibration), "rig_file": 4096, "frame": 80}


def say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def run(*command: str | Path, **settings: Any) -> str:
    """Run a program and return what it printed on standard output."""
    return subprocess.run([str(c) for c in command], check=True, text=True, stdout=subprocess.PIPE, **settings).stdout


def built(preset: str) -> Path:
    """Build a preset and return its folder."""
    say(f"building preset {preset}")
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    run("cmake", "--preset", preset, *generator, cwd=ROOT)
    run("cmake", "--build", ROOT / "build" / preset, "--parallel", cwd=ROOT)
    return ROOT / "build" / preset


def runtime_of(build: Path) -> str:
    """The libonnxruntime that CMake found for this build's tests."""
    line = re.search(r"^ENDOSDK_TEST_RUNTIME:FILEPATH=(.+)$", (build / "CMakeCache.txt").read_text(), re.M)
    if line is None:
        raise SystemExit("no libonnxruntime found: install endosdk[cpu] into .venv")
    return line[1]


def steadiness(arguments: argparse.Namespace) -> dict[str, Any]:
    """Memory, handles and threads before and after many small frames, in one process."""
    build = built("release")
    say(f"{arguments.frames} frames")
    program = build / "cpp" / "tests" / "library" / "library_steadiness"
    return dict(json.loads(run(program, runtime_of(build), TINY_MODEL, str(arguments.frames))))


def overhead(_: argparse.Namespace) -> list[dict[str, Any]]:
    """A frame of the C library against its frame path called directly, in turns."""
    build = built("release")
    program = build / "cpp" / "tests" / "library" / "library_overhead"
    results = []
    for model, width, height, frames in TIMED:
        for threads in (1, 2):
            say(f"overhead: {model.name}, {width}x{height}, {threads} threads")
            numbers = run(program, runtime_of(build), model, str(width), str(height), str(frames), str(threads))
            results.append({"model": model.stem, **json.loads(numbers)})
    return results


def streams(_: argparse.Namespace) -> list[dict[str, Any]]:
    """Frames a second of both faces, one call after the other and streamed, in turns, on the shipped pairs."""
    library = binding.load(built("release") / "cpp" / "libendosdk.so")
    return [streams_of(library, model, size) for model in STREAMED for size in STREAM_SIZES]


def streams_of(library: ctypes.CDLL, name: str, size: tuple[int, int]) -> dict[str, Any]:
    """The same for one model and size of the frames, on two threads."""
    pair = sample_pairs()[0].resized(*size)
    model = shipped_models()[name]
    ours = DepthEstimator(name, calibration=pair.calibration, threads=2)
    theirs = binding.CEstimator(library, model, pair.calibration, threads=2)
    maps = ("disparity", "confidence", "reasons", "depth", "sigma")  # what Python gives
    views = pair.left, pair.right
    answer, room = ours.predict(*views), theirs.predict(*views, maps=maps)
    found = room[1]
    np.testing.assert_array_equal(found["disparity"], answer.disparity)
    calls = {
        "python_calls": lambda frames: [ours.predict(*views, out=answer) for _ in range(frames)],
        "c_calls": lambda frames: [theirs.predict(*views, room=room) for _ in range(frames)],
        "python_stream": lambda frames: deque(ours.stream(repeat(views, frames), reuse=True), maxlen=0),
        "c_stream": lambda frames: deque(theirs.stream(repeat(views, frames), maps), maxlen=0),
    }
    rates: dict[str, list[float]] = {way: [] for way in calls}
    for turn in range(STREAM_TURNS + 1):
        say(f"streams: {name}, {size[0]}x{size[1]}, turn {turn}")
        for way, call in calls.items():
            started = time.perf_counter()
            call(STREAM_FRAMES)
            if turn:  # the first warms up
                rates[way].append(STREAM_FRAMES / (time.perf_counter() - started))
    last = next(iter(theirs.stream(repeat(views, 1), maps)))[1]
    np.testing.assert_array_equal(last["disparity"], found["disparity"])
    theirs.close()
    fps = {way: round(statistics.median(values), 1) for way, values in rates.items()}
    return {"model": name, "size": list(size), "threads": 2, "fps": fps}


def sanitizers(_: argparse.Namespace) -> dict[str, Any]:
    """All C++ tests under each sanitizer; a single report fails its test."""
    results = {}
    for preset in ("asan", "tsan", "ubsan"):
        build = built(preset)
        say(f"testing under {preset}")
        started = time.monotonic()
        report = run("ctest", "--test-dir", build, "--output-on-failure", "--no-tests=error")  # raises when one fails
        names = re.findall(r"Test +#\d+: (\w+) \.+ +Passed", report)
        results[preset] = {"passed": names, "reports": 0, "seconds": round(time.monotonic() - started)}
        say(f"{preset}: {results[preset]}")
    return results


def fuzz(arguments: argparse.Namespace) -> dict[str, Any]:
    """libFuzzer, with address and undefined-behaviour sanitizers, on each kind of input, all at the same time."""
    build = built("fuzz")
    environment = {
        **os.environ,
        "ENDOSDK_ORT_LIBRARY": runtime_of(build),
        "ENDOSDK_FUZZ_MODEL": str(TINY_MODEL),
        "ASAN_OPTIONS": "allocator_may_return_null=1",
    }
    say(f"fuzzing {', '.join(FUZZERS)} for {arguments.fuzz_seconds} s")
    with tempfile.TemporaryDirectory() as scratch:
        running = {}
        for name, longest in FUZZERS.items():
            found = Path(scratch, name)
            found.mkdir()
            if name == "model":
                shutil.copy(TINY_MODEL, found)
            command = [str(build / "cpp" / "fuzz" / f"fuzz_{name}"), f"-max_total_time={arguments.fuzz_seconds}"]
            command += [f"-max_len={longest}", "-print_final_stats=1", "-timeout=60", f"-artifact_prefix={found}-"]
            command += [str(found), str(ROOT / "cpp" / "fuzz" / "corpus" / name)]
            running[name] = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        return {name: fuzz_result(name, process) for name, process in running.items()}


def fuzz_result(name: str, process: subprocess.Popen[str]) -> dict[str, Any]:
    """Wait for one fuzzer; a finding ends everything with its report."""
    _, report = process.communicate()
    if process.returncode != 0:
        raise SystemExit(f"fuzz_{name} found something:\n{report[-6000:]}")
    runs = re.search(r"Done (\d+) runs in (\d+) second", report)
    edges = re.findall(r"cov: (\d+)", report)
    assert runs is not None and edges, report[-2000:]
    return {"seconds": int(runs[2]), "inputs": int(runs[1]), "edges_reached": int(edges[-1]), "failures": 0}


def hashes(part: str) -> Hashes:
    """Return the hashes of the model files that a part runs."""
    measured = {"overhead": [model for model, *_ in TIMED], "streams": STREAMED}.get(part, [TINY_MODEL])
    return {"model_sha256": {Path(model).stem: model_run(model).sha256 for model in measured}}


PARTS = {"steadiness": steadiness, "overhead": overhead, "streams": streams, "sanitizers": sanitizers, "fuzz": fuzz}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--frames", type=int, default=20000)
    parser.add_argument("--fuzz-seconds", type=int, default=600)
    arguments = parser.parse_args()
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    for name in arguments.only:
        found = PARTS[name](arguments)
        command = f"python -m benchmarks.speed.c_library --only {name}"
        write_part(arguments.json, name, {"result": found}, command=command, hashes=hashes(name))
        say(f"{name}: {json.dumps(found)}")


if __name__ == "__main__":
    main()
