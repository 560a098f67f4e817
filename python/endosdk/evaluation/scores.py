"""Score whole pairs, one or many, on all pixels and on those that both cameras see."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument
from endosdk.evaluation.metrics import (
    SIGMA_BIN_EDGES,
    Map,
    Mask,
    answered,
    sigma_bins,
    sigma_gap,
    sparsification_error,
    with_truth,
)

PIXEL_LIMITS = (1, 2, 3, 5)


@dataclass
class _Sums:
    """Running sums of one region; every measure follows from them, so that pictures are pooled by pixels."""

    pixels: int = 0
    answered: int = 0
    error: float = 0.0
    beyond: dict[int, int] = field(default_factory=lambda: dict.fromkeys(PIXEL_LIMITS, 0))
    depth_pixels: int = 0
    depth_error: float = 0.0
    relative_error: float = 0.0
    ranked_pixels: int = 0
    ranked_area: float = 0.0
    sigma: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((3, SIGMA_BIN_EDGES.size - 1)))


class ScoreBoard:
    """Pool pairs by pixels: `add` each, then read `result`.

    All measures are those of one large picture, except ``ause``: sparsification compares pixels inside one picture, so
    the pictures' values are averaged by their pixels.
    """

    def __init__(self) -> None:
        self._regions: dict[str, _Sums] = {}
        self._pairs = 0

    def add(
        self,
        disparity: Map,
        truth: Map,
        *,
        occlusion: Mask | None = None,
        focal_px: float | None = None,
        baseline_mm: float | None = None,
        doffs: float = 0.0,
        sigma: Map | None = None,
        confidence: Map | None = None,
    ) -> None:
        """Add one pair; all maps are [H,W].

        ``occlusion`` is True where only the left camera sees the point. Focal length and baseline give the measures in
        mm. ``sigma`` (mm) is held against the depth error; ``confidence`` (0..1), or sigma where there is none, ranks
        the pixels for ``ause``.
        """
        for name, given in (
            ("disparity", disparity),
            ("occlusion", occlusion),
            ("sigma", sigma),
            ("confidence", confidence),
        ):
            if given is not None and given.shape != truth.shape:
                raise InvalidArgument(name, f"must have the shape of the truth, {truth.shape}", given.shape)
        if occlusion is not None and occlusion.dtype != np.bool_:
            raise InvalidArgument("occlusion", "must be bool", occlusion.dtype)
        if (focal_px is None) != (baseline_mm is None):
            raise InvalidArgument("baseline_mm", "must come together with focal_px", (focal_px, baseline_mm))
        regions: dict[str, Mask | None] = {"all": None}
        if occlusion is not None:
            regions["non_occluded"] = ~occlusion
        depths = None
        if focal_px is not None and baseline_mm is not None:
            product = focal_px * baseline_mm
            depths = _depth(disparity, product, doffs), _depth(truth, product, doffs)
        for name, mask in regions.items():
            sums = self._regions.setdefault(name, _Sums())
            _add_disparity(sums, disparity, truth, mask)
            if depths is not None:
                _add_depth(sums, *depths, mask, sigma)
            _add_ranking(sums, disparity, truth, mask, confidence, sigma)
        self._pairs += 1

    def result(self) -> dict[str, Any]:
        """Return ``pairs`` and, per region, the measures as JSON values; None where no pixel counted."""
        return {"pairs": self._pairs, **{name: _measures(sums) for name, sums in self._regions.items()}}


def evaluate_pair(disparity: Map, truth: Map, **options: Any) -> dict[str, Any]:
    """Score one pair; the options and the result are those of `ScoreBoard`."""
    board = ScoreBoard()
    board.add(disparity, truth, **options)
    return board.result()


def _depth(disparity: Map, focal_times_baseline: float, doffs: float) -> npt.NDArray[np.float64]:
    """Depth in mm; NaN where the disparity puts the point at or behind infinity."""
    shifted = disparity.astype(np.float64) + doffs
    depth: npt.NDArray[np.float64] = np.full(shifted.shape, np.nan)
    np.divide(focal_times_baseline, shifted, out=depth, where=shifted > 0)
    return depth


def _add_disparity(sums: _Sums, disparity: Map, truth: Map, mask: Mask | None) -> None:
    known = answered(disparity, truth, mask)
    errors = np.abs(disparity[known].astype(np.float64) - truth[known])
    sums.pixels += int(with_truth(truth, mask).sum())
    sums.answered += errors.size
    sums.error += float(errors.sum())
    for limit in PIXEL_LIMITS:
        sums.beyond[limit] += int((errors > limit).sum())


def _add_depth(sums: _Sums, depth: Map, truth: Map, mask: Mask | None, sigma: Map | None) -> None:
    known = answered(depth, truth, mask)
    errors = np.abs(depth[known] - truth[known])
    sums.depth_pixels += errors.size
    sums.depth_error += float(errors.sum())
    sums.relative_error += float((errors / truth[known]).sum())
    if sigma is not None:
        both = known & np.isfinite(sigma)
        sums.sigma += sigma_bins(np.abs(depth[both] - truth[both]), sigma[both])


def _add_ranking(
    sums: _Sums, disparity: Map, truth: Map, mask: Mask | None, confidence: Map | None, sigma: Map | None
) -> None:
    uncertainty = sigma if confidence is None else 1 - confidence
    if uncertainty is None:
        return
    known = answered(disparity, truth, mask) & np.isfinite(uncertainty)
    errors = np.abs(disparity[known].astype(np.float64) - truth[known])
    if errors.size:
        sums.ranked_pixels += errors.size
        sums.ranked_area += errors.size * sparsification_error(errors, uncertainty[known].astype(np.float64))


def _measures(sums: _Sums) -> dict[str, Any]:
    measures: dict[str, Any] = {
        "pixels": sums.pixels,
        "answered": sums.answered,
        "coverage": _ratio(sums.answered, sums.pixels),
        "epe_px": _ratio(sums.error, sums.answered),
        **{f"kpe_{limit}": _ratio(count, sums.answered) for limit, count in sums.beyond.items()},
    }
    if sums.depth_pixels:
        measures["depth_pixels"] = sums.depth_pixels
        measures["depth_mae_mm"] = _ratio(sums.depth_error, sums.depth_pixels)
        measures["depth_relative"] = _ratio(sums.relative_error, sums.depth_pixels)
    if sums.sigma[0].any():
        measures["sigma_ece_mm"] = sigma_gap(sums.sigma)
    if sums.ranked_pixels:
        measures["ause"] = _ratio(sums.ranked_area, sums.ranked_pixels)
    return measures


def _ratio(total: float, count: int) -> float | None:
    return total / count if count else None
