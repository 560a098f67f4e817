"""Score a method on a data set with truth, pair by pair and pooled."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.baseline import SgbmBaseline, fill_holes
from endosdk.calibration import StereoCalibration
from endosdk.dataset import DatasetReader, Sample
from endosdk.errors import InvalidArgument
from endosdk.estimator import DepthEstimator
from endosdk.scores import ScoreBoard, evaluate_pair

FloatMap = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Answer:
    """What a method says about one pair; maps [H, W], disparity in px with NaN where it gives no answer."""

    disparity: FloatMap
    confidence: FloatMap | None = None
    sigma: FloatMap | None = None  # mm
    milliseconds: float = 0.0


Method = Callable[[Sample], Answer]


def evaluate(method: Method, reader: DatasetReader, limit: int | None = None) -> dict[str, Any]:
    """Run ``method`` over the first ``limit`` pairs (default: all).

    Returns the pooled measures of `ScoreBoard` for ``all`` and ``non_occluded`` pixels, the median time and ``worst``:
    the ids of the ten pairs with the largest error.
    """
    count = len(reader) if limit is None else min(limit, len(reader))
    if count < 1:
        raise InvalidArgument("limit", "must leave at least one pair", limit)
    board, times, errors = ScoreBoard(), [], []
    started = time.perf_counter()
    for index in range(count):
        sample = reader[index]
        answer = method(sample)
        board.add(
            answer.disparity,
            sample.disparity,
            occlusion=sample.occlusion,
            focal_px=sample.focal_px,
            baseline_mm=sample.baseline_mm,
            doffs=sample.doffs,
            sigma=answer.sigma,
            confidence=answer.confidence,
        )
        errors.append((evaluate_pair(answer.disparity, sample.disparity)["all"]["epe_px"] or float("inf"), sample.id))
        times.append(answer.milliseconds)
        _progress(index + 1, count, time.perf_counter() - started)
    worst = [{"id": name, "epe_px": error} for error, name in sorted(errors, reverse=True)[:10]]
    return {**board.result(), "ms_median": float(np.median(times)), "worst": worst}


def estimator_method(
    model: str, *, provider: str = "cpu", threads: int | None = None, network_size: tuple[int, int] | None = None
) -> Method:
    """Return the method that is a model of ours. Its disparity is dense: every pixel with truth counts."""
    estimators: dict[tuple[int, int, float, float, float], DepthEstimator] = {}

    def answer(sample: Sample) -> Answer:
        height, width = sample.left.shape[:2]
        key = (width, height, sample.focal_px, sample.baseline_mm, sample.doffs)
        if key not in estimators:
            rig = StereoCalibration.rectified(
                focal_px=sample.focal_px, baseline_mm=sample.baseline_mm, size=(width, height), doffs=sample.doffs
            )
            estimators.clear()  # one rig at a time: sets are sorted by camera, and buffers are large
            estimators[key] = DepthEstimator(
                model, calibration=rig, provider=provider, threads=threads, network_size=network_size
            )
        result = estimators[key].predict(sample.left, sample.right)
        return Answer(result.disparity, result.confidence, result.sigma, result.timings.total_ms)

    return answer


def sgbm_method(*, filled: bool) -> Method:
    """Return the method that is StereoSGBM; ``filled`` makes it answer everywhere, as the networks do."""
    matcher = SgbmBaseline()

    def answer(sample: Sample) -> Answer:
        started = time.perf_counter()
        disparity = matcher.compute(sample.left, sample.right)
        elapsed = 1e3 * (time.perf_counter() - started)
        return Answer(fill_holes(disparity) if filled else disparity, milliseconds=elapsed)

    return answer


def _progress(done: int, count: int, elapsed: float) -> None:
    left = elapsed / done * (count - done)
    end = "\n" if done == count else ""
    print(f"\rpair {done} of {count}, {left:.0f} s left   ", end=end, file=sys.stderr, flush=True)
