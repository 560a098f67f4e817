"""The bench of trust: how far a model's own statements hold on clean, on spoilt and on faulty pairs.

    python -m benchmarks.accuracy.trust [--data DIR] [--layout NAME] [--models fast ...] [--usable] --json FILE

Per case: how many of the right pixels are valid, how many of the wrong ones, how many pixels outside the field of
view, how often the error lies within sigma, how well confidence ranks errors, how often a given confidence is right,
and what was said of the frames. A pixel is right within 1 px of the truth, wrong beyond 3 px, of its own frame; those
that the right view does not show, or that lie beyond the model's range, count as neither. Confidence and its ranking
are judged on frames that are not INVALID.
"""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.fault_naming import rig_of
from benchmarks.accuracy.trust_cases import FAULTS, USABLE, Case, next_scene
from benchmarks.model_records import evenly, models_parser, record_models
from endosdk import DepthEstimator, DepthResult, Reason, Status
from endosdk.datasets.dataset import Sample, film_of
from endosdk.datasets.layouts import LAYOUTS, open_dataset
from endosdk.evaluation.metrics import sigma_bins, sigma_gap, sparsification_error
from endosdk.io.progress import progress

CLEAN_SET = Path(__file__).parents[2] / "datasets" / "endosim-gi-cycles"
RIGHT_PX, WRONG_PX = 1.0, 3.0
THRESHOLDS = 0.7, 0.8, 0.9, 0.95  # what `min_confidence` may be
CONFIDENT_TO = 1 / 480  # of the width: the error below which confidence is the probability
CONFIDENCE_BINS = 10  # of equal width


@dataclass
class Tally:
    """Running counts of one case."""

    pixels: Counter[str] = field(default_factory=Counter)
    status: Counter[str] = field(default_factory=Counter)
    causes: Counter[str] = field(default_factory=Counter)
    named: int = 0  # frames that are not OK and name a cause of the case
    areas: list[float] = field(default_factory=list)
    bins: NDArray[np.float64] | None = None
    # By tenths of the confidence [3, bins]: pixels, their confidence, how many have the error that it is about.
    confidence: NDArray[np.float64] = field(default_factory=lambda: np.zeros((3, CONFIDENCE_BINS)))

    def add(self, sample: Sample, answer: DepthResult, case: Case, largest: float) -> None:
        """Count one pair."""
        self.status[answer.status.name] += 1
        self.causes.update(cause.name for cause in answer.causes)
        self.named += case.named_by(answer)
        valid = answer.reasons == 0
        if "outside" in sample.info:
            outside = sample.info["outside"]
            self.pixels["outside"] += int(outside.sum())
            self.pixels["outside_valid"] += int(valid[outside].sum())
        self._add_errors(sample, answer, valid, largest)

    def _add_errors(self, sample: Sample, answer: DepthResult, valid: NDArray[np.bool_], largest: float) -> None:
        known = np.isfinite(sample.disparity) & (sample.disparity < largest) & (sample.disparity > 1.0)
        if sample.occlusion is not None:
            known &= ~sample.occlusion
        error = np.abs(answer.disparity - sample.disparity)
        usable = (answer.reasons & ~np.uint8(Reason.LOW_CONFIDENCE)) == 0
        for name, which in (("right", known & (error <= RIGHT_PX)), ("wrong", known & (error > WRONG_PX))):
            self.pixels[name] += int(which.sum())
            self.pixels[f"{name}_valid"] += int((which & valid).sum())
            for threshold in THRESHOLDS:
                self.pixels[f"{name}_from_{threshold}"] += int(
                    (which & usable & (answer.confidence >= threshold)).sum()
                )
        both = known & valid
        self.pixels["known"] += int(known.sum())
        self.pixels["known_valid"] += int(both.sum())
        if answer.status != Status.INVALID and known.any():
            self._add_confidence(error[known], answer.confidence[known], CONFIDENT_TO * sample.left.shape[1])
        if not both.any() or answer.sigma_map is None:
            return
        product = sample.focal_px * sample.baseline_mm
        depths = np.abs(answer.depth[both] - product / (sample.disparity[both] + sample.doffs)).astype(np.float64)
        sigma = answer.sigma[both]
        self.pixels["with_sigma"] += sigma.size
        self.pixels["within_sigma"] += int((depths <= sigma).sum())
        self.pixels["within_two_sigma"] += int((depths <= 2 * sigma).sum())
        sums = sigma_bins(depths, sigma)
        self.bins = sums if self.bins is None else self.bins + sums

    def _add_confidence(self, error: NDArray[Any], confidence: NDArray[np.float32], limit: float) -> None:
        """Count how sure the network was [N] of disparities with this error [N], px, and how many keep the limit."""
        sure = confidence.astype(np.float64)
        some = slice(None, None, 7)
        self.areas.append(sparsification_error(error[some].astype(np.float64), 1.0 - sure[some]))
        bins = np.minimum((sure * CONFIDENCE_BINS).astype(np.int64), CONFIDENCE_BINS - 1)
        for row, weights in zip(self.confidence, (None, sure, error < limit), strict=True):
            row += np.bincount(bins, weights, minlength=CONFIDENCE_BINS)

    def result(self, case: Case) -> dict[str, Any]:
        """Return the measures of the case."""
        frames = sum(self.status.values())
        n = self.pixels
        found: dict[str, Any] = {
            "pairs": frames,
            "status": dict(self.status),
            "causes": dict(self.causes),
            "right": _share(n["right"], n["known"]),
            "right_called_valid": _share(n["right_valid"], n["right"]),
            "wrong": _share(n["wrong"], n["known"]),
            "wrong_called_valid": _share(n["wrong_valid"], n["wrong"]),
            "wrong_of_valid": _share(n["wrong_valid"], n["known_valid"]),
            "called_valid_by_min_confidence": {
                str(threshold): {name: _share(n[f"{name}_from_{threshold}"], n[name]) for name in ("right", "wrong")}
                for threshold in THRESHOLDS
            },
            "outside_called_valid": _share(n["outside_valid"], n["outside"]),
            "within_sigma": _share(n["within_sigma"], n["with_sigma"]),
            "within_two_sigma": _share(n["within_two_sigma"], n["with_sigma"]),
            "ause": round(float(np.mean(self.areas)), 4) if self.areas else None,
            "confidence_ece": self._confidence_gap(),
            "confidence_bins": self._confidence_bins(),
            "sigma_ece_mm": None if self.bins is None else round(sigma_gap(self.bins), 3),
        }
        if case.causes:
            found["expected"] = [cause.name for cause in case.causes]
            found["named"] = _share(self.named, frames)
        return found

    def _confidence_gap(self) -> float | None:
        """Return the expected calibration error: how far confidence is off in its bins, weighted by their pixels."""
        pixels, sure, right = self.confidence
        return round(float(np.abs(sure - right).sum() / pixels.sum()), 4) if pixels.any() else None

    def _confidence_bins(self) -> dict[str, list[Any]]:
        """Return for each bin its pixels, their mean confidence, and the share with the error that it is about."""
        means = {"confidence": self.confidence[1], "right": self.confidence[2]}
        pixels = [int(count) for count in self.confidence[0]]
        shares = {
            key: [
                round(float(total) / count, 4) if count else None for total, count in zip(totals, pixels, strict=True)
            ]
            for key, totals in means.items()
        }
        return {"pixels": pixels, **shares}


def _share(part: int, whole: int) -> float | None:
    return round(part / whole, 4) if whole else None


def measure(model: str, samples: list[Sample], cases: tuple[Case, ...]) -> dict[str, Any]:
    """Answer every pair in every case."""
    return {case.name: _tally(model, samples, case).result(case) for case in progress(cases, total=len(cases))}


def _tally(model: str, samples: list[Sample], case: Case) -> Tally:
    """Answer every pair of one case, with estimators that saw no other: they remember the frames before."""
    tally = Tally()
    others = [None if number is None else samples[number] for number in next_scene([film_of(s.id) for s in samples])]
    pairs = zip(samples, others, strict=True)
    for rig, taken in groupby(pairs, lambda pair: rig_of(pair[0]) if pair[0].has_camera else None):
        with DepthEstimator(model, calibration=rig, threads=2) as estimator:
            for sample, another in taken:
                largest = estimator.largest_disparity(*sample.left.shape[1::-1]) or np.inf
                spoilt = case.pair(sample, another)
                tally.add(spoilt, estimator.predict(spoilt.left, spoilt.right), case, largest)
    return tally


def main() -> None:
    parser = models_parser(__doc__, "so many pairs, evenly from the whole split")
    parser.set_defaults(data=CLEAN_SET, models=["fast"], pairs=60)
    next(action for action in parser._actions if action.dest == "data").required = False
    parser.add_argument("--layout", choices=LAYOUTS, default="endosdk", help="of the set (default: %(default)s)")
    some = parser.add_mutually_exclusive_group()
    some.add_argument("--cases", nargs="+", help="only these; the others stay in the record")
    some.add_argument("--usable", action="store_true", help="only those without a fault")
    args = parser.parse_args()
    ours = args.layout == "endosdk"
    reader = open_dataset(args.data, args.split) if ours else open_dataset(args.data, args.split, args.layout)
    samples = [reader[number] for number in evenly(args.pairs, len(reader))]
    cases = USABLE if args.usable else (*USABLE, *FAULTS)
    if args.cases:
        cases = tuple(case for case in cases if case.name in args.cases)
    more = ("" if ours else f" --layout {args.layout}") + (" --usable" if args.usable else "")
    more += f" --cases {shlex.join(args.cases)}" if args.cases else ""
    part = "cases" if args.cases or args.usable else None
    record_models(args, reader, lambda model: {"cases": measure(model, samples, cases)}, more, part)


if __name__ == "__main__":
    main()
