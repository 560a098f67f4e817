"""Score whole pairs, one or many, on all pixels and on parts of them.

The parts, where there is what they need: ``non_occluded`` and ``occluded``, that both cameras see and that only the
left one sees; ``edges``, near a depth edge (`endosdk.evaluation.edges`); ``glare``, ``low_texture`` and
``instrument_edges``, where the left view is hard to match (`endosdk.evaluation.frame_parts`); ``in_range``, whose true
disparity the method can find; ``valid``, on which it stands by its answer.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument
from endosdk.evaluation.edges import flying_pixels, near_edges
from endosdk.evaluation.frame_parts import Picture, glare, instrument_edges, low_texture
from endosdk.evaluation.metrics import (
    SIGMA_BIN_EDGES,
    Map,
    Mask,
    compared,
    finite_or_nan,
    sigma_bins,
    sigma_gap,
    sparsification_error,
    with_truth,
)

PIXEL_LIMITS = (1, 2, 3, 5)
RANKED = ("all", "non_occluded")  # parts with ``ause``, which takes longer than everything else


@dataclass
class _Sums:
    """Running sums of one part; every measure follows from them, so that pictures are pooled by pixels."""

    pixels: int = 0
    valid: int = 0
    error: float = 0.0
    beyond: dict[int, int] = field(default_factory=lambda: dict.fromkeys(PIXEL_LIMITS, 0))
    flying: int | None = None
    bent_pixels: int = 0
    bend: float = 0.0
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
        self._pooled: dict[str, _Sums] = {}
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
        valid: Mask | None = None,
        largest_px: float | None = None,
        view: Picture | None = None,
        instruments: bool = False,
    ) -> None:
        """Add one pair; all maps are [H,W].

        ``occlusion`` is True where only the left camera sees the point. Focal length and baseline give the measures in
        mm. ``sigma`` (mm) is held against the depth error; ``confidence`` (0..1), or sigma where there is none, ranks
        the pixels for ``ause``. ``valid`` is True where the method stands by its answer, ``largest_px`` the largest
        disparity that it can find. ``view`` is the left picture, which tells the parts that are hard to match, with
        ``instruments`` the edges of instruments too.
        """
        masks = {"occlusion": occlusion, "valid": valid}
        _check_maps(truth, {"disparity": disparity, "sigma": sigma, "confidence": confidence, **masks})
        for name, mask in masks.items():
            if mask is not None and mask.dtype != np.bool_:
                raise InvalidArgument(name, "must be bool", mask.dtype)
        if (focal_px is None) != (baseline_mm is None):
            raise InvalidArgument("baseline_mm", "must come together with focal_px", (focal_px, baseline_mm))
        disparity, truth = finite_or_nan(disparity), finite_or_nan(truth)
        depths = None
        if focal_px is not None and baseline_mm is not None:
            product = focal_px * baseline_mm
            depths = _depth(disparity, product, doffs), _depth(truth, product, doffs)
        near = near_edges(truth)
        parts = _parts(truth, near, occlusion, valid, largest_px)
        if view is not None:
            _check_maps(truth, {"view": view[..., 0] > 0})
            parts |= {"glare": glare(view), "low_texture": low_texture(view)}
            parts |= {"instrument_edges": instrument_edges(view, truth)} if instruments else {}
        for name, mask in parts.items():
            sums = self._pooled.setdefault(name, _Sums())
            _add_disparity(sums, disparity, truth, mask)
            if depths is not None:
                _add_depth(sums, *depths, mask, sigma)
            if name in RANKED:
                _add_ranking(sums, disparity, truth, mask, confidence, sigma)
        edges = self._pooled["edges"]
        edges.flying = (edges.flying or 0) + int(flying_pixels(disparity, truth).sum())
        _add_bend(self._pooled["all"], disparity, truth, near)
        self._pairs += 1

    def result(self) -> dict[str, Any]:
        """Return ``pairs`` and, per part, the measures as JSON values; None where no pixel counted.

        ``share`` says how many of the pixels with truth are in the part.
        """
        parts = {name: _measures(sums, self._pooled["all"].pixels) for name, sums in self._pooled.items()}
        return {"pairs": self._pairs, **parts}


def evaluate_pair(disparity: Map, truth: Map, **options: Any) -> dict[str, Any]:
    """Score one pair; the options and the result are those of `ScoreBoard`."""
    board = ScoreBoard()
    board.add(disparity, truth, **options)
    return board.result()


def _check_maps(truth: Map, maps: dict[str, Map | Mask | None]) -> None:
    for name, given in maps.items():
        if given is not None and given.shape != truth.shape:
            raise InvalidArgument(name, f"must have the shape of the truth, {truth.shape}", given.shape)


def _parts(
    truth: Map, edges: Mask, occlusion: Mask | None, valid: Mask | None, largest_px: float | None
) -> dict[str, Mask | None]:
    parts: dict[str, Mask | None] = {"all": None}
    if occlusion is not None:
        parts |= {"non_occluded": ~occlusion, "occluded": occlusion}
    parts["edges"] = edges
    if largest_px is not None:
        parts["in_range"] = truth <= largest_px
    if valid is not None:
        parts["valid"] = valid
    return parts


def _depth(disparity: Map, focal_times_baseline: float, doffs: float) -> npt.NDArray[np.float64]:
    """Depth in mm; NaN where the disparity puts the point at or behind infinity."""
    shifted = disparity.astype(np.float64) + doffs
    depth: npt.NDArray[np.float64] = np.full(shifted.shape, np.nan)
    np.divide(focal_times_baseline, shifted, out=depth, where=shifted > 0)
    return depth


def _add_disparity(sums: _Sums, disparity: Map, truth: Map, mask: Mask | None) -> None:
    known = compared(disparity, truth, mask)
    errors = np.abs(disparity[known].astype(np.float64) - truth[known])
    sums.pixels += int(with_truth(truth, mask).sum())
    sums.valid += errors.size
    sums.error += float(errors.sum())
    for limit in PIXEL_LIMITS:
        sums.beyond[limit] += int((errors > limit).sum())


def _add_bend(sums: _Sums, disparity: Map, truth: Map, edges: Mask) -> None:
    """Add how much the error bends from pixel to pixel of a row, away from edges: noise, which no mean error shows."""
    errors = np.where(edges, np.nan, disparity.astype(np.float64) - truth)
    bends = np.abs(errors[:, 2:] - 2 * errors[:, 1:-1] + errors[:, :-2])
    known = np.isfinite(bends)
    sums.bent_pixels += int(known.sum())
    sums.bend += float(bends[known].sum())


def _add_depth(sums: _Sums, depth: Map, truth: Map, mask: Mask | None, sigma: Map | None) -> None:
    known = compared(depth, truth, mask)
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
    known = compared(disparity, truth, mask) & np.isfinite(uncertainty)
    errors = np.abs(disparity[known].astype(np.float64) - truth[known])
    if errors.size:
        sums.ranked_pixels += errors.size
        sums.ranked_area += errors.size * sparsification_error(errors, uncertainty[known].astype(np.float64))


def _measures(sums: _Sums, pixels: int) -> dict[str, Any]:
    measures: dict[str, Any] = {
        "pixels": sums.pixels,
        "share": _ratio(sums.pixels, pixels),
        "valid": sums.valid,
        "coverage": _ratio(sums.valid, sums.pixels),
        "epe_px": _ratio(sums.error, sums.valid),
        **{f"kpe_{limit}": _ratio(count, sums.valid) for limit, count in sums.beyond.items()},
    }
    if sums.flying is not None:
        measures["flying"] = _ratio(sums.flying, sums.valid)
    if sums.bent_pixels:
        measures["noise_px"] = _ratio(sums.bend, sums.bent_pixels)
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
