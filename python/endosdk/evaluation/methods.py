"""Score a method on a data set with truth, pair by pair and pooled."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.calibration.rig import StereoCalibration
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.errors import DatasetInvalid, InvalidArgument, StorageFailed
from endosdk.evaluation.frame_parts import has_instruments
from endosdk.evaluation.scores import ScoreBoard, evaluate_pair
from endosdk.evaluation.sgbm import SgbmBaseline, SgbmSettings, fill_holes
from endosdk.io.pictures import write_picture
from endosdk.io.progress import progress
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.overview import error_overview

FloatMap = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

WORST_PAIRS = 10


@dataclass(frozen=True)
class Answer:
    """What a method says about one pair; maps [H, W], disparity in px with NaN where it gives no answer."""

    disparity: FloatMap
    confidence: FloatMap | None = None
    sigma: FloatMap | None = None  # mm
    valid: Mask | None = None  # where the method stands by its answer
    largest_px: float | None = None  # disparity that the method can find
    milliseconds: float = 0.0


Method = Callable[[Sample], Answer]


def require_pairs(reader: DatasetReader) -> None:
    """Raise InvalidArgument, naming the split, when there is no pair in it."""
    if len(reader) == 0:
        raise InvalidArgument("data", f"must have pairs in its split {reader.split}", f"none in {reader.name}")


def evaluate(method: Method, reader: DatasetReader, pairs: int | None = None) -> dict[str, Any]:
    """Run ``method`` over the first ``pairs`` pairs (default: all).

    Returns the pooled measures of `ScoreBoard` for each part of the pixels, the median time and ``worst``: id, index
    and error of the ten pairs with the largest error (None where a pair got no answer at all). Raises InvalidArgument
    when there is no pair and for a method that returns no `Answer`, DatasetInvalid when no pair has truth.
    """
    require_pairs(reader)
    if pairs is not None and pairs < 1:
        raise InvalidArgument("pairs", "must be at least 1", pairs)
    count = len(reader) if pairs is None else min(pairs, len(reader))
    board, times, errors = ScoreBoard(), [], []
    for index in progress(range(count)):
        sample = reader[index]
        answer = method(sample)
        if not isinstance(answer, Answer):
            raise InvalidArgument("method", "must return an Answer, such as Answer(disparity)", type(answer).__name__)
        board.add(
            answer.disparity,
            sample.disparity,
            occlusion=sample.occlusion,
            focal_px=sample.focal_px if sample.has_camera else None,
            baseline_mm=sample.baseline_mm if sample.has_camera else None,
            doffs=sample.doffs,
            sigma=answer.sigma,
            confidence=answer.confidence,
            valid=answer.valid,
            largest_px=answer.largest_px,
            view=sample.left,
            instruments=has_instruments(sample.info),
        )
        errors.append((_pair_error(answer, sample), sample.id, index))
        times.append(answer.milliseconds)
    measures = board.result()
    if not measures["all"]["pixels"]:
        raise DatasetInvalid("dataset", f"must have truth in its split {reader.split}", f"none in {count} pairs")
    ranked = sorted(errors, reverse=True)[:WORST_PAIRS]
    worst = [{"id": name, "index": index, "epe_px": _finite(error)} for error, name, index in ranked]
    return {**measures, "ms_median": float(np.median(times)), "worst": worst}


def write_worst(method: Method, reader: DatasetReader, scores: dict[str, Any], folder: Path) -> list[Path]:
    """Draw the worst pairs of ``scores``, which `evaluate` returned for this method and reader; return the files.

    Those of an earlier evaluation, which may be of other pairs, are removed from ``folder``.
    """
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for earlier in folder.glob("[0-9][0-9]_*.png"):
            earlier.unlink()
    except OSError as error:
        raise StorageFailed("out", "the folder must be writable", error) from error
    for rank, entry in enumerate(scores["worst"], start=1):
        sample = reader[entry["index"]]
        found = "no answer" if entry["epe_px"] is None else f"{entry['epe_px']:.3f} px"
        picture = error_overview(
            sample.left, method(sample).disparity, sample.disparity, f"{rank}. {sample.id}: mean error {found}"
        )
        written.append(folder / f"{rank:02d}_{sample.id.replace('/', '_')}.png")
        write_picture(written[-1], picture)
    return written


def estimator_method(
    model: str,
    *,
    provider: str = "cpu",
    provider_options: Mapping[str, str] | None = None,
    threads: int | None = None,
    network_size: tuple[int, int] | None = None,
) -> Method:
    """Return the method that is a model of ours. Its disparity is dense: every pixel with truth counts."""
    estimators: dict[tuple[int, int, tuple[float, float, float] | None], DepthEstimator] = {}

    def answer(sample: Sample) -> Answer:
        height, width = sample.left.shape[:2]
        camera = (sample.focal_px, sample.baseline_mm, sample.doffs) if sample.has_camera else None
        key = (width, height, camera)
        if key not in estimators:
            rig = None if camera is None else StereoCalibration.rectified(*camera[:2], (width, height), doffs=camera[2])
            estimators.clear()  # one rig at a time: sets are sorted by camera, and buffers are large
            with _range_unsaid():
                estimators[key] = DepthEstimator(
                    model,
                    calibration=rig,
                    provider=provider,
                    provider_options=provider_options,
                    threads=threads,
                    network_size=network_size,
                )
            estimators[key].prepare(width, height)  # what the first frame takes longer is not the time of a pair
        estimator = estimators[key]
        result = estimator.predict(sample.left, sample.right)
        return Answer(
            result.disparity,
            result.confidence,
            result.sigma_map,
            valid=result.reasons == 0,
            largest_px=estimator.largest_disparity(width, height),
            milliseconds=result.timings.total_ms,
        )

    return answer


def sgbm_method(*, filled: bool, settings: SgbmSettings | None = None) -> Method:
    """Return the method that is StereoSGBM; ``filled`` makes it answer everywhere, as the networks do."""
    matcher = SgbmBaseline(settings)

    def answer(sample: Sample) -> Answer:
        started = time.perf_counter()
        disparity = matcher.compute(sample.left, sample.right)
        elapsed = 1e3 * (time.perf_counter() - started)
        largest = float(matcher.settings.max_disparity - 1)
        shown = fill_holes(disparity) if filled else disparity
        return Answer(shown, valid=np.isfinite(disparity), largest_px=largest, milliseconds=elapsed)

    return answer


@contextmanager
def _range_unsaid() -> Iterator[None]:
    """Log no line on the range of a rig: a set may have a rig for every pair, and the scores say what lies in range."""
    logger = logging.getLogger("endosdk.rigs")
    logger.addFilter(_nothing)
    try:
        yield
    finally:
        logger.removeFilter(_nothing)


def _nothing(record: logging.LogRecord) -> bool:
    return False


def _pair_error(answer: Answer, sample: Sample) -> float:
    """Mean error of one pair, px; infinite without an answer, and -1, so that it ranks last, without any truth."""
    measures = evaluate_pair(answer.disparity, sample.disparity)["all"]
    if not measures["pixels"]:
        return -1.0
    return float("inf") if measures["epe_px"] is None else float(measures["epe_px"])


def _finite(error: float) -> float | None:
    return error if 0 <= error < float("inf") else None
