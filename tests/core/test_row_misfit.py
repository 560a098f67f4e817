"""Pictures that are bent, or of two moments, are called distorted where they are, and have no confidence there."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy.trust_cases import FAULTS, USABLE
from endosdk import Cause, DepthEstimator, DepthResult, Status, _core
from endosdk.datasets.dataset import Sample
from tests.core.test_pose_error import RIG, cycles_pair
from tests.reference.row_misfit import row_misfit

LIMIT = _core.cause_facts[Cause.DISTORTED]["degraded"]


@pytest.mark.parametrize("bands", [30, 31, 2])
@pytest.mark.parametrize("along", [119, 120, 11])
@pytest.mark.parametrize("seed", range(4))
def test_equals_twin(bands: int, along: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest = rng.normal(0, 0.5, (bands, along)).astype(np.float32)
    for _ in range(seed):
        y, x = rng.integers(bands), rng.integers(along)
        rest[y : y + 8, x : x + 30] += np.float32(rng.choice([-3.0, 1.0, 1.5, 3.0]))
    rest[rng.random(rest.shape) < 0.2 * seed] = np.nan
    share, kept = _core.row_misfit(rest, 0.8)
    if bands < 3 or along < 12:
        assert np.isnan(share) and kept is None
        return
    expected_share, expected = row_misfit(rest, 0.8, LIMIT)
    assert share == pytest.approx(expected_share)
    assert (kept is None) == (expected is None)
    if expected is not None:
        np.testing.assert_array_equal(kept, expected)


def test_a_few_measurements_or_wrong_matches_are_no_misfit() -> None:
    rest = np.full((30, 119), np.nan, np.float32)
    rest[::3, ::4] = 5.0  # three of a part
    assert _core.row_misfit(rest, 0.8) == (0.0, None)
    strays = np.random.default_rng(0).normal(1.0, 3.0, (30, 119)).astype(np.float32)
    assert _core.row_misfit(strays, 0.8)[0] < LIMIT


def test_a_part_alone_counts_half() -> None:
    rest = np.zeros((30, 120), np.float32)
    rest[3:6, 12:24] = rest[21:24, 84:96] = 2.0
    alone = _core.row_misfit(rest, 0.8)[0]
    rest[3:6, 24:36] = rest[24:27, 96:108] = 2.0
    assert alone == pytest.approx(0.01) and _core.row_misfit(rest, 0.8)[0] == pytest.approx(4 * alone)


def test_parts_that_are_off_their_rows_by_little_keep_their_depth() -> None:
    rest = np.zeros((30, 120), np.float32)
    rest[:, 60:] = 1.0
    share, kept = _core.row_misfit(rest, 0.8)
    assert share == pytest.approx(0.5) and kept is not None and kept.all()
    rest[3:6, 84:96] = 1.3
    kept = _core.row_misfit(rest, 0.8)[1]
    assert kept is not None and set(np.argwhere(kept == 0)[:, 0]) == {0, 1, 2} and (kept == 0).sum() == 9


def answer(number: int, name: str) -> tuple[DepthResult, DepthResult]:
    """The answers for a rendered pair as it is, and spoilt as in the bench of trust."""
    left, right = cycles_pair(number)
    sample = Sample(f"{number}", left, right, np.zeros(left.shape[:2], np.float32), None, None, 400.0, 10.0)
    spoilt = next(case for case in (*USABLE, *FAULTS) if case.name == name).pair(sample)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        return estimator.predict(left, right), estimator.predict(spoilt.left, spoilt.right)


@pytest.mark.parametrize("number", [0, 1])
def test_liquid_on_a_lens_is_named_and_leaves_no_depth(number: int) -> None:
    clean, bent = answer(number, "right bent by 4 px, as by liquid")
    assert Cause.DISTORTED not in clean.causes and clean.measures[Cause.DISTORTED] < LIMIT
    assert bent.status != Status.OK and bent.causes[Cause.DISTORTED] > 2 * LIMIT
    assert (bent.reasons == 0).mean() < 0.25 * (clean.reasons == 0).mean()


def test_a_part_of_another_moment_loses_its_depth_and_the_rest_keeps_it() -> None:
    clean, torn = answer(0, "a part of the right from another moment")
    assert torn.status == Status.DEGRADED and Cause.DISTORTED in torn.causes
    was_valid, valid = clean.reasons == 0, torn.reasons == 0
    wrong = was_valid & (np.abs(torn.disparity - clean.disparity) > 3)
    assert wrong.mean() > 0.05  # there is something to find
    assert (wrong & valid).sum() < 0.15 * wrong.sum()
    assert (was_valid & ~wrong & valid).sum() > 0.5 * (was_valid & ~wrong).sum()


@pytest.mark.parametrize("name", ["JPEG of quality 20", "noise of 12 grey levels", "rows 2 px off", "glare on 30 %"])
def test_pictures_that_are_only_bad_are_not_distorted(name: str) -> None:
    spoilt = answer(1, name)[1]
    assert spoilt.measures[Cause.DISTORTED] < LIMIT
