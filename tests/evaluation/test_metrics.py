"""Every measure against a case worked out by hand, and against what must hold for any input."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.evaluation import metrics

NAN = np.nan
TRUTH = np.array([[10.0, 20.0, 30.0], [40.0, NAN, 50.0]], np.float32)
GUESS = np.array([[10.0, 21.5, 26.0], [NAN, 7.0, 50.5]], np.float32)
# Answered pixels with truth: errors 0, 1.5, 4, 0.5.


def test_end_point_error_by_hand() -> None:
    assert metrics.end_point_error(GUESS, TRUTH) == pytest.approx(1.5)


@pytest.mark.parametrize(("k", "share"), [(0.4, 0.75), (1, 0.5), (1.5, 0.25), (2, 0.25), (3, 0.25), (4, 0.0), (5, 0.0)])
def test_k_pixel_error_counts_strictly_larger_errors(k: float, share: float) -> None:
    assert metrics.k_pixel_error(GUESS, TRUTH, k) == share


def test_coverage_counts_answers_among_truth_only() -> None:
    assert metrics.coverage(GUESS, TRUTH) == pytest.approx(4 / 5)
    assert metrics.coverage(np.full_like(TRUTH, NAN), TRUTH) == 0.0


def test_infinite_values_are_no_answer_and_no_truth() -> None:
    guess = np.array([1.0, np.inf, 3.0], np.float32)
    truth = np.array([1.0, 2.0, -np.inf], np.float32)
    assert metrics.coverage(guess, truth) == 0.5
    assert metrics.end_point_error(guess, truth) == 0.0


def test_mask_narrows_every_measure() -> None:
    mask = np.array([[True, False, False], [True, True, True]])
    assert metrics.end_point_error(GUESS, TRUTH, mask) == pytest.approx(0.25)
    assert metrics.k_pixel_error(GUESS, TRUTH, 0.4, mask) == 0.5
    assert metrics.coverage(GUESS, TRUTH, mask) == pytest.approx(2 / 3)
    assert metrics.depth_error(GUESS, TRUTH, mask) == pytest.approx(0.25)
    assert metrics.relative_depth_error(GUESS, TRUTH, mask) == pytest.approx((0 + 0.5 / 50) / 2)


def test_depth_errors_by_hand() -> None:
    truth, guess = np.array([[50.0, 100.0]]), np.array([[52.0, 95.0]])
    assert metrics.depth_error(guess, truth) == pytest.approx(3.5)
    assert metrics.relative_depth_error(guess, truth) == pytest.approx((0.04 + 0.05) / 2)


@pytest.mark.parametrize(
    "measure", [metrics.end_point_error, metrics.coverage, metrics.depth_error, metrics.relative_depth_error]
)
def test_no_pixel_gives_nan_without_a_warning(measure) -> None:
    assert np.isnan(measure(GUESS, np.full_like(TRUTH, NAN)))


@pytest.mark.parametrize(
    ("guess", "mask"),
    [(GUESS[:, :2], None), (GUESS, np.ones((2, 2), bool)), (GUESS, np.ones((2, 3), np.uint8))],
)
def test_shapes_and_mask_type_are_checked(guess, mask) -> None:
    with pytest.raises(InvalidArgument):
        metrics.end_point_error(guess, TRUTH, mask)


def test_sparsification_by_hand() -> None:
    # 100 pixels, one of them wrong by 1 and believed to be the best: the curve climbs from 0.01 to 1 while the oracle
    # drops to 0 at the first step, so the gap at step n is 1 / (100 - n) for n >= 1, over an overall mean of 0.01.
    errors = np.zeros(100)
    errors[0] = 1.0
    uncertainty = np.arange(100.0)
    expected = sum(1 / (100 - n) for n in range(1, 100)) / 100 / 0.01
    assert metrics.sparsification_error(errors, uncertainty) == pytest.approx(expected)


def test_sparsification_is_zero_for_the_oracle_and_any_growing_function_of_it() -> None:
    errors = np.random.default_rng(1).exponential(size=5000)
    assert metrics.sparsification_error(errors, errors) == 0.0
    assert metrics.sparsification_error(errors, np.log1p(errors)) == 0.0


def test_sparsification_ranks_useful_above_useless_above_inverted() -> None:
    rng = np.random.default_rng(2)
    errors = rng.exponential(size=20000)
    useful = metrics.sparsification_error(errors, errors + rng.normal(size=errors.size))
    useless = metrics.sparsification_error(errors, rng.random(errors.size))
    constant = metrics.sparsification_error(errors, np.zeros(errors.size))
    inverted = metrics.sparsification_error(errors, -errors)
    assert 0 < useful < useless < inverted
    # Random order and "all the same" both keep the mean error at every step.
    assert useless == pytest.approx(constant, abs=0.02)


def test_sparsification_does_not_depend_on_the_order_of_equal_uncertainties() -> None:
    rng = np.random.default_rng(3)
    errors, uncertainty = rng.exponential(size=1000), rng.integers(0, 4, 1000).astype(float)
    order = rng.permutation(1000)
    shuffled = metrics.sparsification_error(errors[order], uncertainty[order])
    assert shuffled == pytest.approx(metrics.sparsification_error(errors, uncertainty))


def test_sparsification_of_a_perfect_map_and_of_nothing() -> None:
    assert metrics.sparsification_error(np.zeros(10), np.arange(10.0)) == 0.0
    assert np.isnan(metrics.sparsification_error(np.zeros(0), np.zeros(0)))


def test_calibration_error_by_hand() -> None:
    # Two bins: sigma 1 with errors of 3 and 1 (mean 2), and sigma 8 with an error of 8.
    errors, sigma = np.array([3.0, 1.0, 8.0]), np.array([1.0, 1.0, 8.0])
    expected = (2 * (2 - 1) + 1 * 0) / 3
    assert metrics.sigma_calibration_error(errors, sigma) == pytest.approx(expected)


def test_calibration_error_is_small_for_honest_sigma_and_grows_with_boasting() -> None:
    rng = np.random.default_rng(4)
    sigma = rng.uniform(0.1, 10, 200_000)
    errors = np.abs(rng.laplace(scale=sigma))  # whose expected absolute value is the scale, as sigma states it
    assert metrics.sigma_calibration_error(errors, sigma) < 0.05
    assert metrics.sigma_calibration_error(errors, sigma / 2) > 1.0
    assert metrics.sigma_calibration_error(errors, sigma * 1.41) > 1.0


def test_calibration_error_pools_over_pictures() -> None:
    rng = np.random.default_rng(5)
    sigma = rng.uniform(0.1, 10, 1000)
    errors = rng.exponential(size=1000)
    parts = metrics.sigma_bins(errors[:300], sigma[:300]) + metrics.sigma_bins(errors[300:], sigma[300:])
    assert metrics.sigma_gap(parts) == pytest.approx(metrics.sigma_calibration_error(errors, sigma))


@pytest.mark.parametrize("sigma", [1e-9, 1e9])
def test_sigma_beyond_the_bins_still_counts(sigma: float) -> None:
    assert metrics.sigma_calibration_error(np.array([2.0]), np.array([sigma])) == pytest.approx(abs(2.0 - sigma))


@pytest.mark.parametrize("measure", [metrics.sparsification_error, metrics.sigma_calibration_error])
def test_lists_of_different_length_are_refused(measure) -> None:
    with pytest.raises(InvalidArgument, match="shape"):
        measure(np.zeros(3), np.zeros(4))
