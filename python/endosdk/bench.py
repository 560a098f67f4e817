"""Time a model end to end on rendered raw pairs whose truth is known; the answer is checked before the clock starts."""

from __future__ import annotations

import itertools
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.baseline import SgbmBaseline, fill_holes
from endosdk.errors import InferenceFailed, InvalidArgument, StorageFailed
from endosdk.estimator import DepthEstimator
from endosdk.machine import machine_record
from endosdk.metrics import end_point_error
from endosdk.rectify import RectifyStage
from endosdk.samples import RawPair, sample_pairs

Picture = npt.NDArray[np.uint8]

# A model whose error on the shipped pairs is beyond this share of the mean disparity is not working, and its speed
# would mean nothing.
BROKEN_SHARE = 0.25


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


def run_benchmark(settings: BenchSettings) -> dict[str, Any]:
    """Run the benchmark and return its record (see the README of ``benchmarks`` for every key)."""
    for name, value in (("frames", settings.frames), ("warmup", settings.warmup)):
        if value < 1:
            raise InvalidArgument(name, "must be at least 1", value)
    pairs = [pair.resized(*settings.size) for pair in sample_pairs()]
    # All shipped pairs come from one rig, so one estimator serves them all.
    estimator = DepthEstimator(
        settings.model,
        calibration=pairs[0].calibration,
        provider=settings.provider,
        threads=settings.threads,
        network_size=settings.network_size,
    )
    epe = _checked_error(estimator, pairs)
    total, stages = _time_frames(estimator, pairs, settings)
    streamed = _time_stream(estimator, pairs, settings)
    rivals = {"sgbm": _time_sgbm(pairs, settings)} if settings.against == "sgbm" else {}
    return {
        "command": " ".join(["endosdk-bench", *sys.argv[2:]]),
        "model": {
            "name": estimator.model.name,
            "version": estimator.model.version,
            "sha256": estimator.model.sha256,
        },
        "size": list(settings.size),
        "network_size": list(estimator.diagnostics()["network_size"]),
        "provider": estimator.diagnostics()["provider"],
        "frames": settings.frames,
        "epe_px": epe,
        "fps": 1000 / float(np.mean(total)),
        "stream_fps": streamed,
        "startup_s": _startup_seconds(settings),
        "latency_ms": _spread(total),
        "stages_ms": {name: float(np.median(values)) for name, values in stages.items()},
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "against": rivals,
        "machine": {**machine_record(), "threads": settings.threads, "kernels": estimator.diagnostics()["kernels"]},
    }


def write_record(path: Path, record: dict[str, Any]) -> None:
    """Write one record as JSON."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record, indent=2) + "\n")
    except OSError as error:
        raise StorageFailed("json", "the file must be writable", error) from error


def _checked_error(estimator: DepthEstimator, pairs: list[RawPair]) -> float:
    """Mean error over the shipped pairs, px; refuse to time a model that gives nonsense."""
    errors = [_error(estimator.predict(pair.left, pair.right).disparity, pair) for pair in pairs]
    epe = float(np.mean(errors))
    limit = BROKEN_SHARE * float(np.mean([np.nanmean(pair.disparity) for pair in pairs]))
    if not epe < limit:
        raise InferenceFailed(
            "model", f"must be within {limit:.1f} px of the truth before it is timed", f"{epe:.2f} px"
        )
    return epe


def _time_frames(
    estimator: DepthEstimator, pairs: list[RawPair], settings: BenchSettings
) -> tuple[list[float], dict[str, list[float]]]:
    result = None
    total: list[float] = []
    stages: dict[str, list[float]] = {"rectify": [], "session": [], "postprocess": []}
    for number in range(settings.warmup + settings.frames):
        _progress(number, settings.warmup + settings.frames)
        pair = pairs[number % len(pairs)]
        started = time.perf_counter()
        result = estimator.predict(pair.left, pair.right, out=result)
        elapsed = 1e3 * (time.perf_counter() - started)
        if number < settings.warmup:
            continue
        total.append(elapsed)
        stages["rectify"].append(result.timings.rectify_ms)
        stages["session"].append(result.timings.session_ms)
        stages["postprocess"].append(result.timings.postprocess_ms)
    return total, stages


def _time_stream(estimator: DepthEstimator, pairs: list[RawPair], settings: BenchSettings) -> float:
    """Frames a second of `DepthEstimator.stream`, which rectifies the next frame beside the network."""
    count = settings.warmup + settings.frames
    source = ((pair.left, pair.right) for pair in itertools.islice(itertools.cycle(pairs), count))
    started = time.perf_counter()
    for number, _ in enumerate(estimator.stream(source, reuse=True), start=1):
        _progress(number, count)
        if number == settings.warmup:
            started = time.perf_counter()
    return settings.frames / (time.perf_counter() - started)


def _startup_seconds(settings: BenchSettings) -> float:
    """Seconds from the import to the first answer in a fresh process; median of three."""
    width, height = settings.size
    program = (
        "import time; begun = time.perf_counter()\n"
        "import sys, endosdk, numpy\n"
        f"frame = numpy.zeros(({height}, {width}, 3), numpy.uint8)\n"
        f"estimator = endosdk.DepthEstimator(sys.argv[1], provider=sys.argv[2], threads={settings.threads}, "
        f"network_size={settings.network_size})\n"
        "estimator.predict(frame, frame)\n"
        "print(time.perf_counter() - begun)"
    )
    command = [sys.executable, "-c", program, settings.model, settings.provider]
    return sorted(float(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(3))[1]


def _time_sgbm(pairs: list[RawPair], settings: BenchSettings) -> dict[str, Any]:
    """Time StereoSGBM (three paths) on the same rectified pictures; rectification is not counted against it."""
    import cv2

    rectified, errors, answered = [], [], []
    matcher = SgbmBaseline()
    before = cv2.getNumThreads()
    cv2.setNumThreads(settings.threads)
    try:
        for pair in pairs:
            rectified.append(_rectified(pair))
            disparity = matcher.compute(*rectified[-1])
            answered.append(float(np.isfinite(disparity).mean()))
            errors.append(_error(fill_holes(disparity), pair))
        milliseconds = _time_calls(lambda i: matcher.compute(*rectified[i % len(pairs)]), settings)
    finally:
        cv2.setNumThreads(before)
    return {
        "fps": 1000 / float(np.mean(milliseconds)),
        "epe_px": float(np.mean(errors)),
        "answered_share": float(np.mean(answered)),
        "latency_ms": _spread(milliseconds),
        "includes": "matching of rectified pictures only; holes are filled for the error, not for the time",
    }


def _rectified(pair: RawPair) -> tuple[Picture, Picture]:
    """Rectify at the size of the frames, whatever size the network works at. RGB uint8 [H, W, 3]."""
    height, width = pair.left.shape[:2]
    left, right = (np.empty((3, height, width), np.uint8) for _ in range(2))
    RectifyStage((width, height), pair.calibration, (width, height))(pair.left, pair.right, left, right, "rgb")
    return np.ascontiguousarray(left.transpose(1, 2, 0)), np.ascontiguousarray(right.transpose(1, 2, 0))


def _time_calls(call: Callable[[int], object], settings: BenchSettings) -> list[float]:
    frames = min(settings.frames, 100)  # its spread is small; a rival need not double the waiting time
    milliseconds = []
    for number in range(settings.warmup + frames):
        _progress(number, settings.warmup + frames)
        started = time.perf_counter()
        call(number)
        if number >= settings.warmup:
            milliseconds.append(1e3 * (time.perf_counter() - started))
    return milliseconds


def _error(disparity: npt.NDArray[np.float32], pair: RawPair) -> float:
    return float(end_point_error(disparity, pair.disparity))


def _spread(milliseconds: list[float]) -> dict[str, float]:
    p50, p95, p99 = np.percentile(milliseconds, (50, 95, 99))
    return {"p50": float(p50), "p95": float(p95), "p99": float(p99), "max": max(milliseconds)}


def _progress(number: int, count: int) -> None:
    if sys.stderr.isatty() and number % max(1, count // 100) == 0:
        print(f"\rframe {number} of {count}", end="" if number + 1 < count else "\n", file=sys.stderr, flush=True)
