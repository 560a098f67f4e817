"""Patches looked for without the network: against the numpy twin, and on rendered pairs with known faults."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk import Cause, DepthEstimator, Status, _core
from tests.conftest import shifted_pair
from tests.core.test_pose_error import RIG, cycles_pair, turned
from tests.core_rigs import every_isa
from tests.reference import matched_views, resampling

HEIGHT, WIDTH = 150, 240


def planes(view: np.ndarray) -> np.ndarray:
    return resampling.planar(view, "rgb", 152, 240).astype(np.uint8)


@every_isa
@pytest.mark.parametrize("rows", [0, 5, 8])
@pytest.mark.parametrize("exchanged", [False, True])
def test_equals_twin(isa: str, rows: int, exchanged: bool, restored_settings: None) -> None:
    left, right = shifted_pair(HEIGHT, WIDTH, 9)
    right = cv2.GaussianBlur(np.roll(right, rows, axis=0), (0, 0), 1.5)
    left = cv2.GaussianBlur(left, (0, 0), 1.5)
    pair = (right, left) if exchanged else (left, right)
    views = [planes(view) for view in pair]
    _core.set_isa("plain")
    plain = _core.coarse_match(*views, (WIDTH, HEIGHT))
    _core.set_isa(isa)
    seen = _core.coarse_match(*views, (WIDTH, HEIGHT))
    np.testing.assert_array_equal(seen, plain)
    expected = matched_views.coarse_match(*views, (WIDTH, HEIGHT))
    np.testing.assert_allclose(seen, expected, atol=1e-4)
    if rows == 0:
        assert (expected[0] > 0.2) == exchanged
    elif not exchanged:
        assert expected[1] == pytest.approx(rows / 2, abs=0.3)  # a row of brightness is two of the picture


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
    assert lower.causes[Cause.NOT_RECTIFIED] == pytest.approx(24, abs=1)
    assert lower.causes[Cause.RIG_MOVED] == pytest.approx(
        np.degrees(24 / 400), rel=0.25
    )  # it lies lower, and is no turn
    assert turned_far.causes[Cause.NOT_RECTIFIED] > 12
    assert turned_far.causes[Cause.RIG_MOVED] == pytest.approx(2.5, abs=0.4)
    assert other.status == Status.INVALID
    assert not {Cause.NOT_RECTIFIED, Cause.RIG_MOVED, Cause.SWAPPED} & set(other.causes)


def test_rows_that_are_off_are_named_where_most_pixels_find_a_match() -> None:
    """`accurate` calls most of these pixels valid, and no rotation fits what it finds."""
    left, right = cycles_pair(34)
    with DepthEstimator("accurate", calibration=RIG) as estimator:
        lower = estimator.predict(left, np.roll(right, 10, axis=0))
    assert lower.measures[Cause.FEW_VALID] >= 0.5
    assert lower.status != Status.OK
    assert lower.causes[Cause.NOT_RECTIFIED] == pytest.approx(10, abs=1)
    assert Cause.RIG_MOVED in lower.causes
