"""Patches looked for without the network: against the numpy twin, and on rendered pairs with known faults."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk import Cause, DepthEstimator, Status, _core
from tests.conftest import shifted_pair
from tests.core.test_pose_error import RIG, cycles_pair, turned
from tests.reference import matched_views, resampling

HEIGHT, WIDTH = 150, 240


def planes(view: np.ndarray) -> np.ndarray:
    return resampling.planar(view, "rgb", 152, 240).astype(np.uint8)


@pytest.mark.parametrize("rows", [0, 8])
@pytest.mark.parametrize("exchanged", [False, True])
def test_equals_twin(rows: int, exchanged: bool) -> None:
    left, right = shifted_pair(HEIGHT, WIDTH, 9)
    right = cv2.GaussianBlur(np.roll(right, rows, axis=0), (0, 0), 1.5)
    left = cv2.GaussianBlur(left, (0, 0), 1.5)
    pair = (right, left) if exchanged else (left, right)
    views = [planes(view) for view in pair]
    seen = _core.coarse_match(*views, (WIDTH, HEIGHT))
    expected = matched_views.coarse_match(*views, (WIDTH, HEIGHT))
    np.testing.assert_allclose(seen, expected, atol=1e-4)
    if rows == 0:
        assert (expected[0] > 0.2) == exchanged
    elif not exchanged:
        assert expected[1] == rows / 2  # a row of brightness is two of the picture


def test_flat_views_tell_nothing() -> None:
    flat = np.full((3, HEIGHT + 2, WIDTH), 90, np.uint8)
    assert np.isnan(_core.coarse_match(flat, flat, (WIDTH, HEIGHT))).all()
    assert np.isnan(_core.coarse_match(flat[:, :8, :8].copy(), flat[:, :8, :8].copy(), (8, 8))).all()


def test_faults_of_a_pair_are_named() -> None:
    left, right = cycles_pair(5)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        swapped = estimator.predict(right, left)
        lower = estimator.predict(left, np.roll(right, 24, axis=0))
        other = estimator.predict(left, right[::-1].copy())
        turned_far = estimator.predict(left, turned(right, (2.5, 0.0, 0.0)))
    assert swapped.status == Status.INVALID and Cause.SWAPPED in swapped.causes
    assert not {Cause.NOT_RECTIFIED, Cause.RIG_MOVED} & set(swapped.causes)
    assert lower.causes[Cause.NOT_RECTIFIED] == pytest.approx(24, abs=4)
    assert turned_far.causes[Cause.NOT_RECTIFIED] > 12 and Cause.RIG_MOVED not in turned_far.causes
    assert other.status == Status.INVALID
    assert not {Cause.NOT_RECTIFIED, Cause.RIG_MOVED, Cause.SWAPPED} & set(other.causes)
