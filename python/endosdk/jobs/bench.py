"""Time a model end to end on rendered raw pairs whose truth is known; the answer is checked before the clock starts."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import StereoCalibration
from endosdk.datasets.samples import RawPair, sample_pairs
from endosdk.errors import InferenceFailed, InvalidArgument
from endosdk.evaluation.metrics import end_point_error
from endosdk.evaluation.sgbm import FloatMap, SgbmBaseline, SgbmSettings, fill_holes
from endosdk.io.progress import progress
from endosdk.jobs.machine import machine_record
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.rectify import rectified

Picture = npt.NDArray[np.uint8]

# A method whose error on the shipped pairs is beyond this share of the mean disparity is not working, and its speed
# would mean nothing.
BROKEN_SHARE = 0.25

STAGES = ("rectify", "session", "postprocess")

# Methods take turns, so that other load on the machine hits all of them.
TURNS = 5
OTHER_FRAMES = 100  # at most: their spread is small, and they need not double the waiting time

# A stream is timed from one answer to a later one. Over fewer frames for each one in flight, the rate would be that of
# answers which were ready before the clock started.
STREAM_FRAMES = 5

# A program that keeps one processor busy. It is told the number of the process that started it, and ends when that
# process is gone, even if it was killed.
BUSY = """
import os, sys
while os.getppid() == int(sys.argv[1]):
    for _ in range(10**6): pass
"""


@dataclass(frozen=True)
class BenchSettings:
    """What to time."""

    model: str
    size: tuple[int, int]  # (width, height) of the camera frames, px
    network_size: tuple[int, int] | None
    threads: int
    frames: int
    warmup: int
    provider: str
    against: str | None
    provider_options: Mapping[str, str] | None = None
    load: int = 0  # processes that burden the cores while frames are timed


def run_benchmark(settings: BenchSettings) -> dict[str, Any]:
    """Run the benchmark and return its record (see the README of ``benchmarks`` for every key).

    ``window`` is the part of the shipped pairs, (x, y, width, height) in px, that was resized to ``size``: the frames
    of another rig, with whose rectified truth ``epe_px`` is measured.
    """
    if settings.warmup < 1:
        raise InvalidArgument("warmup", "must be at least 1", settings.warmup)
    fewest = TURNS * STREAM_FRAMES * settings.threads
    if settings.frames < fewest:
        raise InvalidArgument("frames", f"must be at least {fewest} for {settings.threads} threads", settings.frames)
    shipped = sample_pairs()
    pairs = [pair.resized(*settings.size) for pair in shipped]
    # All shipped pairs come from one rig, so one estimator serves them all.
    estimator = DepthEstimator(
        settings.model,
        calibration=pairs[0].calibration,
        provider=settings.provider,
        provider_options=settings.provider_options,
        threads=settings.threads,
        network_size=settings.network_size,
    )
    epe = _checked_error(estimator, pairs)
    sgbm = _Sgbm(pairs, settings) if settings.against == "sgbm" else None
    with burdened(settings.load):
        frames, streamed = _time_in_turns(estimator, sgbm, pairs, settings)
    total = [frame[0] for frame in frames]
    startup, memory = _fresh_process(settings, pairs[0].calibration)
    return {
        "command": _command(settings),
        "model": estimator.model.identity(),
        "size": list(settings.size),
        "window": list(shipped[0].window(*settings.size)),
        "network_size": [estimator.diagnostics()[f"network_{side}"] for side in ("width", "height")],
        "provider": estimator.diagnostics()["provider"],
        "provider_options": estimator.diagnostics()["provider_options"],
        "frames": settings.frames,
        "load": settings.load,
        "epe_px": epe,
        "fps": 1000 / float(np.mean(total)),
        "stream_fps": streamed,
        "startup_s": startup,
        "latency_ms": _spread(total),
        "stages_ms": {
            name: float(np.median([frame[stage] for frame in frames])) for stage, name in enumerate(STAGES, start=1)
        },
        "peak_rss_mb": memory,
        "against": {} if sgbm is None else {"sgbm": sgbm.record()},
        "machine": {**machine_record(), "threads": settings.threads, "kernels": estimator.diagnostics()["kernels"]},
    }


@contextmanager
def burdened(processes: int) -> Iterator[None]:
    """Keep so many other processes busy meanwhile, each with a core if it gets one."""
    if processes < 0:
        raise InvalidArgument("load", "must be at least 0", processes)
    busy = [subprocess.Popen([sys.executable, "-c", BUSY, str(os.getpid())]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def _command(settings: BenchSettings) -> str:
    """Return the command that measures the same again; of a file only its name: no private paths."""
    size, network = ("x".join(map(str, pair)) if pair else None for pair in (settings.size, settings.network_size))
    words = ["endosdk-bench", "--model", Path(settings.model).name, "--size", str(size)]
    words += ["--network-size", network] if network else []
    for name in ("threads", "frames", "warmup", "provider"):
        words += [f"--{name}", str(getattr(settings, name))]
    words += ["--load", str(settings.load)] if settings.load else []
    for key, value in (settings.provider_options or {}).items():
        words += ["--provider-option", f"{key}={value}"]
    return " ".join([*words, "--against", settings.against or "none"])


def _checked_error(estimator: DepthEstimator, pairs: list[RawPair]) -> float:
    """Mean error over the shipped pairs, px; refuse to time a model that gives nonsense."""
    return _not_broken("model", [estimator.predict(pair.left, pair.right).disparity for pair in pairs], pairs)


def _not_broken(argument: str, found: list[FloatMap], pairs: list[RawPair]) -> float:
    """Return the mean error of these maps, px; refuse a method that gives nonsense."""
    epe = float(np.mean([end_point_error(*maps) for maps in zip(found, (p.disparity for p in pairs), strict=True)]))
    limit = BROKEN_SHARE * float(np.mean([np.nanmean(pair.disparity) for pair in pairs]))
    if not epe < limit:
        raise InferenceFailed(
            argument, f"must be within {limit:.1f} px of the truth before it is timed", f"{epe:.2f} px"
        )
    return epe


def _time_in_turns(
    estimator: DepthEstimator, sgbm: _Sgbm | None, pairs: list[RawPair], settings: BenchSettings
) -> tuple[list[tuple[float, float, float, float]], float]:
    """Milliseconds of every frame, in all and by stage, and the frames a second of a stream."""
    frames: list[tuple[float, float, float, float]] = []
    stream_seconds, streamed = 0.0, 0
    for turn in progress(range(TURNS), unit="turn"):
        first, end = settings.frames * turn // TURNS, settings.frames * (turn + 1) // TURNS
        frames += time_frames(estimator, pairs, settings.warmup, end - first)
        others = min(end - first, OTHER_FRAMES // TURNS)
        count = max(others, STREAM_FRAMES * settings.threads)
        stream_seconds += _time_stream(estimator, pairs, settings.warmup, count)
        streamed += count
        if sgbm is not None:
            sgbm.time(settings.warmup, others)
    return frames, streamed / stream_seconds


def time_frames(
    estimator: DepthEstimator, pairs: list[RawPair], warmup: int, count: int
) -> list[tuple[float, float, float, float]]:
    """Milliseconds of every frame after the warm-up: in all, then by stage."""
    result = None
    frames = []
    for number in range(warmup + count):
        pair = pairs[number % len(pairs)]
        started = time.perf_counter()
        result = estimator.predict(pair.left, pair.right, out=result)
        elapsed = 1e3 * (time.perf_counter() - started)
        spent = result.timings
        frames.append((elapsed, spent.rectify_ms, spent.session_ms, spent.postprocess_ms))
    return frames[warmup:]


def _time_stream(estimator: DepthEstimator, pairs: list[RawPair], warmup: int, count: int) -> float:
    """Seconds that `DepthEstimator.stream` takes for so many frames."""
    source = ((pair.left, pair.right) for pair in itertools.islice(itertools.cycle(pairs), warmup + count))
    started = 0.0
    for number, _ in enumerate(estimator.stream(source, reuse=True), start=1):
        if number == warmup:
            started = time.perf_counter()
    return time.perf_counter() - started


def _fresh_process(settings: BenchSettings, rig: StereoCalibration) -> tuple[float, float | None]:
    """Seconds from the import to the first answer in a fresh process (median of three), and its peak memory, MB.

    The memory is None where the system does not tell it.
    """
    width, height = settings.size
    program = (
        "import time; begun = time.perf_counter()\n"
        "import sys, endosdk, numpy\n"
        "rig = endosdk.StereoCalibration.load(sys.argv[3])\n"
        f"frame = numpy.zeros(({height}, {width}, 3), numpy.uint8)\n"
        "estimator = endosdk.DepthEstimator(sys.argv[1], calibration=rig, provider=sys.argv[2], "
        f"threads={settings.threads}, network_size={settings.network_size}, "
        f"provider_options={dict(settings.provider_options or {})})\n"
        "estimator.predict(frame, frame)\n"
        "seconds = time.perf_counter() - begun\n"
        "from endosdk.jobs.machine import peak_memory_mb\n"
        "import json; print(json.dumps([seconds, peak_memory_mb()]))"
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.json"
        rig.save(file)
        command = [sys.executable, "-c", program, settings.model, settings.provider, str(file)]
        runs = [json.loads(_said(command)) for _ in range(3)]
    memories = [memory for _, memory in runs if memory is not None]
    return sorted(seconds for seconds, _ in runs)[1], max(memories, default=None)


def _said(command: list[str]) -> str:
    """Return what a program prints. Raises InferenceFailed with its last words where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["nothing"])[-1]
        raise InferenceFailed("bench", "a new process must open the model and answer", last)
    return done.stdout


class _Sgbm:
    """StereoSGBM (three paths) on the same rectified pictures; rectification is not counted against it.

    It searches the disparities that there are, so that its time is that of a search which finds them.
    """

    def __init__(self, pairs: list[RawPair], settings: BenchSettings) -> None:
        self._threads = settings.threads
        self._matcher = SgbmBaseline(SgbmSettings(max_disparity=_range_of(pairs)))
        self._milliseconds: list[float] = []
        self._rectified = [rectified(pair.left, pair.right, pair.calibration) for pair in pairs]
        found = [self._matcher.compute(*views) for views in self._rectified]
        self._answered = float(np.mean([np.isfinite(disparity).mean() for disparity in found]))
        self._epe = _not_broken("against", [fill_holes(disparity) for disparity in found], pairs)

    def time(self, warmup: int, count: int) -> None:
        """Time so many frames more."""
        import cv2

        before = cv2.getNumThreads()
        cv2.setNumThreads(self._threads)
        try:
            for number in range(warmup + count):
                started = time.perf_counter()
                self._matcher.compute(*self._rectified[number % len(self._rectified)])
                if number >= warmup:
                    self._milliseconds.append(1e3 * (time.perf_counter() - started))
        finally:
            cv2.setNumThreads(before)

    def record(self) -> dict[str, Any]:
        """Return what was measured, JSON-ready."""
        return {
            "fps": 1000 / float(np.mean(self._milliseconds)),
            "epe_px": self._epe,
            "coverage": self._answered,
            "max_disparity": self._matcher.settings.max_disparity,
            "latency_ms": _spread(self._milliseconds),
            "includes": "matching of rectified pictures only; holes are filled for the error, not for the time",
        }


def _range_of(pairs: list[RawPair]) -> int:
    """Return how many disparities hold the truth of all pairs; StereoSGBM takes multiples of 16."""
    most = max(float(np.nanmax(pair.disparity)) for pair in pairs)
    return 16 * math.ceil((most + 1) / 16)


def _spread(milliseconds: list[float]) -> dict[str, float]:
    p50, p95, p99 = np.percentile(milliseconds, (50, 95, 99))
    return {"p50": float(p50), "p95": float(p95), "p99": float(p99), "max": max(milliseconds)}
