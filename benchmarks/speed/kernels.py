"""Time the compiled kernels against OpenCV + numpy doing the same work, on the same pictures, in the same run.

    python -m benchmarks.speed.kernels --json FILE

Each pair of forms is first checked to give the same answer, then timed turn by turn, so that other load on the
machine hits both. Read medians and ratios.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.record import NO_MODEL, write_record
from endosdk import _core

SIZES = ((960, 720), (1920, 1080))
THREADS = (1, 2)
STRIDE = 8  # of the network's maps
MIN_CONFIDENCE, MAX_DEPTH_MM = 0.3, 300.0

Task = Callable[[], Any]


def tissue_picture(width: int, height: int, seed: int) -> np.ndarray:
    """A picture uint8 [height, width, 3] with the scales of an endoscope's: folds, blotches, vessels, fine grain."""
    rng = np.random.default_rng(seed)
    picture = np.zeros((height, width, 3), np.float32)
    picture += np.array([70, 75, 150], np.float32)
    for cell, weight in ((4, 6), (12, 10), (60, 14), (240, 22)):
        noise = rng.standard_normal((height // cell + 3, width // cell + 3, 3)).astype(np.float32)
        layer = cv2.resize(noise, None, fx=cell, fy=cell, interpolation=cv2.INTER_CUBIC)
        picture += weight * layer[:height, :width]
    for _ in range(24):
        steps = rng.normal(0, 0.15, 400).cumsum() + rng.uniform(0, 2 * np.pi)
        start = rng.uniform(0, (width, height))
        path = start + 5 * np.stack([np.cos(steps), np.sin(steps)], axis=1).cumsum(axis=0)
        cv2.polylines(picture, [path.astype(np.int32)], False, (45, 40, 110), int(rng.integers(1, 4)), cv2.LINE_AA)
    return np.clip(cv2.GaussianBlur(picture, (0, 0), 0.8), 0, 255).astype(np.uint8)


@dataclass
class RawRig:
    """A distorted, misaligned rig of the given size."""

    width: int
    height: int

    def views(self) -> list[tuple]:
        """Model, K, distortion, R, P of left and right."""
        focal, lens = 0.9 * self.width, np.array([-0.2, 0.08, 0.001, -0.0007, -0.01])
        left = np.array([[focal, 0, self.width / 2 + 5], [0, 1.003 * focal, self.height / 2 - 3], [0, 0, 1]])
        right = left + np.array([[0, 0, -9], [0, 0, 2], [0, 0, 0]])
        turn = cv2.Rodrigues(np.array([0.01, -0.02, 0.008]))[0]
        numbers = ("pinhole", left, lens, right, lens, turn, [-4.5, 0.05, 0.03], self.width, self.height, 0.0)
        R1, R2, P1, P2 = _core.stereo_rectify(*numbers)
        return [("pinhole", left, lens, R1, P1), ("pinhole", right, lens, R2, P2)]


def rectify_tasks(width: int, height: int) -> tuple[dict[str, Task], Callable[[], None]]:
    """Three routes from a raw BGR pair to planar RGB, and a check that they agree."""
    views = RawRig(width, height).views()
    frames = [tissue_picture(width, height, seed) for seed in range(2)]
    rectifier = _core.Rectifier(width, height, width, height, *views)
    maps = [cv2.initUndistortRectifyMap(k, d, r, p, (width, height), cv2.CV_16SC2) for _, k, d, r, p in views]
    ours, theirs, split = (np.zeros((2, 3, height, width), np.uint8) for _ in range(3))

    def run_ours() -> None:
        rectifier.rectify(frames[0], frames[1], ours[0], ours[1], "bgr")

    def run_opencv() -> None:
        for frame, (first, second), out in zip(frames, maps, theirs, strict=True):
            rgb = cv2.cvtColor(cv2.remap(frame, first, second, cv2.INTER_LINEAR), cv2.COLOR_BGR2RGB)
            np.copyto(out, rgb.transpose(2, 0, 1))

    def run_opencv_split() -> None:
        for frame, (first, second), out in zip(frames, maps, split, strict=True):
            cv2.split(cv2.remap(frame, first, second, cv2.INTER_LINEAR), [out[2], out[1], out[0]])

    def check() -> None:
        for other in (theirs, split):
            within = np.mean(np.abs(ours.astype(int) - other) <= 1)
            require(within >= 0.999, f"rectified pictures agree on {within:.4%} of pixels only")

    return {"ours": run_ours, "opencv": run_opencv, "opencv_split": run_opencv_split}, check


def map_tasks(width: int, height: int) -> tuple[dict[str, Task], Callable[[], None]]:
    """Two routes from the network's maps to all full-size outputs, and a check that they agree.

    The view that the network saw is as small as its maps: a larger one would guide the upsampling, which the others
    have nothing for.
    """
    disparity, confidence = network_maps(width, height)
    seen = tissue_picture(width // STRIDE, height // STRIDE, 5)
    seen[: height // STRIDE // 4, : width // STRIDE // 4] = 255  # glare
    image = np.ascontiguousarray(seen.transpose(2, 0, 1))
    valid = np.ones((height, width), np.uint8)
    focal, baseline = 0.83 * width, 4.5
    ours = {name: np.zeros((height, width), np.float32) for name in ("disparity", "confidence", "depth", "sigma")}
    ours["reasons"] = np.zeros((height, width), np.uint8)
    theirs: dict[str, np.ndarray] = {}
    columns = np.arange(width, dtype=np.float32)

    def run_ours() -> None:
        fields = {"disparity": disparity, "confidence": confidence, "left": image}
        fields |= {"scale": (1 / STRIDE, 1 / STRIDE), "view_scale": (1 / STRIDE, 1 / STRIDE), "gain": float(STRIDE)}
        fields |= {"valid_left": valid, "valid_right": valid, "min_confidence": MIN_CONFIDENCE}
        geometry = {"focal_px": focal, "baseline_mm": baseline, "max_depth_mm": MAX_DEPTH_MM}
        _core.postprocess(fields | geometry, ours)

    def run_numpy() -> None:
        d = cv2.resize(disparity, (width, height), interpolation=cv2.INTER_LINEAR)
        d *= STRIDE
        c = cv2.resize(confidence, (width, height), interpolation=cv2.INTER_LINEAR)
        match = columns - d
        cover = np.minimum.accumulate(match[:, ::-1], axis=1)[:, ::-1]
        nearest = np.clip(np.rint(match), 0, width - 1).astype(np.intp)
        outside = (match < 0) | (valid == 0) | (np.take_along_axis(valid, nearest, axis=1) == 0)
        z = np.float32(focal * baseline) / d
        reasons = (c < MIN_CONFIDENCE).astype(np.uint8)
        reasons |= (cover < match - 1).astype(np.uint8) << 1
        reasons |= outside.astype(np.uint8) << 2
        reasons |= (~((d > 0) & (z <= MAX_DEPTH_MM))).astype(np.uint8) << 3
        glare = (image.min(axis=0) >= 250).astype(np.uint8)
        reasons |= cv2.resize(glare, (width, height), interpolation=cv2.INTER_NEAREST_EXACT) << 4
        z[reasons != 0] = np.nan
        scale = -np.log1p(-np.clip(c, 1e-6, 1 - 1e-6))
        sigma = z * z * np.float32(STRIDE / (focal * baseline)) / scale
        theirs.update(disparity=d, confidence=c, reasons=reasons, depth=z, sigma=sigma)

    def check() -> None:
        same = ours["reasons"] == theirs["reasons"]
        require(np.mean(same) >= 0.999, f"reasons agree on {np.mean(same):.4%} of pixels only")
        good = same & (ours["reasons"] == 0)
        require(np.mean(good) > 0.3, "the scene leaves too few usable pixels")
        for name in ("disparity", "confidence", "depth", "sigma"):
            close = np.allclose(ours[name][good], theirs[name][good], rtol=1e-3, atol=1e-3)
            require(close, f"{name} differs between the routes")

    return {"ours": run_ours, "numpy": run_numpy}, check


def network_maps(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Disparity and confidence as a network of stride 8 gives them: smooth walls, a nearer fold, a few doubts."""
    h, w = height // STRIDE, width // STRIDE
    y, x = np.mgrid[:h, :w].astype(np.float32)
    rng = np.random.default_rng(2)
    disparity = 2.6 + 1.5 * x / w + 0.7 * np.sin(y / 9) + rng.normal(0, 0.01, (h, w))
    disparity[h // 3 : h // 2, w // 2 : w // 2 + w // 6] += 2.5
    confidence = np.clip(rng.beta(5, 1.5, (h, w)), 0, 1)
    return disparity.astype(np.float32), confidence.astype(np.float32)


def require(holds: bool, message: str) -> None:
    """End the run: a wrong answer has no speed."""
    if not holds:
        raise SystemExit(f"benchmarks.speed.kernels: {message}")


def time_in_turns(tasks: dict[str, Task], repeats: int) -> dict[str, float]:
    """Median milliseconds of each task."""
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(repeats):
        for name, task in tasks.items():
            start = time.perf_counter()
            task()
            times[name].append(1e3 * (time.perf_counter() - start))
    return {name: float(np.median(values)) for name, values in times.items()}


def measure(name: str, width: int, height: int, threads: int, repeats: int) -> dict[str, Any]:
    """Check and time one kernel at one size and number of threads."""
    tasks, check = {"rectify": rectify_tasks, "resize_depth": map_tasks}[name](width, height)
    _core.set_threads(threads)
    cv2.setNumThreads(threads)
    for task in tasks.values():
        task()
    check()
    time_in_turns(tasks, 3)
    medians = time_in_turns(tasks, repeats)
    ratios = {name: round(medians[name] / medians["ours"], 2) for name in medians if name != "ours"}
    rounded = {task: round(value, 3) for task, value in medians.items()}
    return {
        "kernel": name,
        "size": f"{width}x{height}",
        "threads": threads,
        "median_ms": rounded,
        "times_faster": ratios,
    }


def main(arguments: list[str] | None = None) -> int:
    """Run all combinations, print a table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed.kernels", description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="where to write the results")
    parser.add_argument("--repeats", type=int, default=60, help="timed turns per combination (default 60)")
    options = parser.parse_args(arguments)
    results = []
    for name in ("rectify", "resize_depth"):
        for width, height in SIZES:
            for threads in THREADS:
                row = measure(name, width, height, threads, options.repeats)
                results.append(row)
                print(f"{name:13} {row['size']:>9} {threads} threads  {row['median_ms']}  {row['times_faster']}x")
    if options.json:
        record = {
            "instruction_set": _core.isa(),
            "opencv": cv2.__version__,
            "load_average": [round(load, 2) for load in os.getloadavg()],  # other work on the machine blurs the times
            "results": results,
        }
        command = f"python -m benchmarks.speed.kernels --repeats {options.repeats}"
        write_record(options.json, record, command=command, hashes=NO_MODEL)
    return 0


if __name__ == "__main__":
    sys.exit(main())
