"""The measures by which endosdk compares disparity and depth with truth, defined once.

Maps are float arrays of one shape [H,W]. A truth that is not finite is no truth; a prediction that is not finite is
no answer. Errors are taken over pixels that have both, and `coverage` says what share of the truth was answered: a
method that leaves hard pixels out improves its error and pays in coverage, so the two belong in one table. To count
unanswered pixels as wrong, fill them before the call. ``mask`` (bool [H,W]) narrows every measure, for instance to the
pixels that both cameras see. A measure over no pixel is NaN.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument

Map = npt.NDArray[np.floating[Any]]
Mask = npt.NDArray[np.bool_]
Errors = npt.NDArray[np.float64]

# Steps of the sparsification curve: after each, another hundredth of the pixels is taken away.
SPARSIFICATION_STEPS = 100
# Bins of the calibration error: a quarter of an octave of sigma, 2^-10 to 2^10 mm. They are fixed, so that sums over
# many pictures can be pooled; a sigma beyond the ends goes into the end bins.
SIGMA_BIN_EDGES = 2.0 ** np.arange(-10.0, 10.01, 0.25)


def end_point_error(disparity: Map, truth: Map, mask: Mask | None = None) -> float:
    """Mean |d - d*| in px."""
    return _mean(np.abs(_differences(disparity, truth, mask)))


def k_pixel_error(disparity: Map, truth: Map, k: float, mask: Mask | None = None) -> float:
    """Share (0..1) of compared pixels with |d - d*| > k px."""
    return _mean(np.abs(_differences(disparity, truth, mask)) > k)


def depth_error(depth: Map, truth: Map, mask: Mask | None = None) -> float:
    """Mean |z - z*| in mm."""
    return _mean(np.abs(_differences(depth, truth, mask)))


def relative_depth_error(depth: Map, truth: Map, mask: Mask | None = None) -> float:
    """Mean |z - z*| / z*; the truth must be positive."""
    known = compared(depth, truth, mask)
    return _mean(np.abs(depth[known] - truth[known], dtype=np.float64) / truth[known])


def coverage(prediction: Map, truth: Map, mask: Mask | None = None) -> float:
    """Share (0..1) of the pixels with truth that have an answer."""
    known = with_truth(truth, mask)
    _check_shapes(prediction, truth)
    return _mean(np.isfinite(prediction[known]))


def sparsification_error(errors: Errors, uncertainty: Errors) -> float:
    """Area between the sparsification curve and its oracle (AUSE), relative to the mean error; 0 is perfect.

    ``errors`` and ``uncertainty`` are flat and belong to the same pixels. The curve is the mean error of what remains
    when the most uncertain share is removed; the oracle removes the largest errors first. Both are divided by the mean
    error of all pixels. Pixels of equal uncertainty count with their common mean, so their order does not matter.
    """
    if errors.shape != uncertainty.shape or errors.ndim != 1:
        raise InvalidArgument("uncertainty", f"must be flat, of shape {errors.shape} like errors", uncertainty.shape)
    if errors.size == 0:
        return float("nan")
    overall = float(errors.mean(dtype=np.float64))
    if overall == 0:
        return 0.0
    _, group, counts = np.unique(uncertainty, return_inverse=True, return_counts=True)
    group_means = np.bincount(group, weights=errors) / counts
    by_uncertainty = np.repeat(group_means, counts)
    gap = _kept_means(by_uncertainty) - _kept_means(np.sort(errors))
    # Summing the groups rounds; an area below zero is only that.
    return max(0.0, float(gap.mean()) / overall)


def sigma_calibration_error(depth_errors: Errors, sigma: Map) -> float:
    """Return the expected calibration error of ``sigma`` in mm; both lists are flat, one entry a pixel.

    Sigma is the expected absolute error. Pixels are binned by it. In each bin the mean absolute depth error should be
    the mean sigma; the gaps are averaged by the number of pixels.
    """
    if depth_errors.shape != sigma.shape or sigma.ndim != 1:
        raise InvalidArgument("sigma", f"must be flat, of shape {depth_errors.shape} like depth_errors", sigma.shape)
    return sigma_gap(sigma_bins(depth_errors, sigma))


def sigma_bins(depth_errors: Errors, sigma: Map) -> Errors:
    """Return the sums [3, bins] that the calibration error needs: pixels, absolute errors, sigma."""
    bins = np.clip(np.searchsorted(SIGMA_BIN_EDGES, sigma, side="right") - 1, 0, SIGMA_BIN_EDGES.size - 2)
    size = SIGMA_BIN_EDGES.size - 1
    summed = None, np.abs(depth_errors), sigma
    return np.stack([np.bincount(bins, weights=weights, minlength=size).astype(np.float64) for weights in summed])


def sigma_gap(sums: Errors) -> float:
    """Return the calibration error of sums made by `sigma_bins`, which may be added over many pictures."""
    counts, errors, sigma = sums[:, sums[0] > 0]
    if counts.size == 0:
        return float("nan")
    return float(np.abs(errors - sigma).sum() / counts.sum())


def finite_or_nan(values: Map) -> Map:
    """Return a map in which everything that is not finite is NaN: infinities say "no answer" as NaN does."""
    return np.where(np.isfinite(values), values, np.nan).astype(values.dtype)


def with_truth(truth: Map, mask: Mask | None = None) -> Mask:
    """Return where there is truth, inside the mask."""
    known = np.isfinite(truth)
    if mask is None:
        return known
    if mask.shape != truth.shape or mask.dtype != np.bool_:
        raise InvalidArgument("mask", f"must be bool of shape {truth.shape}", f"{mask.dtype} {mask.shape}")
    return known & mask


def compared(prediction: Map, truth: Map, mask: Mask | None = None) -> Mask:
    """Return where there are truth and answer, inside the mask."""
    _check_shapes(prediction, truth)
    return with_truth(truth, mask) & np.isfinite(prediction)


def _check_shapes(prediction: Map, truth: Map) -> None:
    if prediction.shape != truth.shape:
        raise InvalidArgument("prediction", f"must have the shape of the truth, {truth.shape}", prediction.shape)


def _differences(prediction: Map, truth: Map, mask: Mask | None) -> Errors:
    known = compared(prediction, truth, mask)
    return prediction[known].astype(np.float64) - truth[known]


def _mean(values: npt.NDArray[Any]) -> float:
    return float(values.mean(dtype=np.float64)) if values.size else float("nan")


def _kept_means(errors: Errors) -> Errors:
    """Mean of the first n, n-1%, ... errors of a list whose last are removed first."""
    sums = np.cumsum(errors, dtype=np.float64)
    shares = 1 - np.arange(SPARSIFICATION_STEPS) / SPARSIFICATION_STEPS
    kept = np.maximum(1, np.ceil(shares * errors.size - 1e-9).astype(np.int64))
    return np.asarray(sums[kept - 1] / kept)
