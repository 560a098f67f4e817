"""Pictures that repeat themselves along their rows: against the numpy twin, and in whole frames."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk import Cause, DepthEstimator, Status, _core
from tests.conftest import shifted_pair
from tests.core.test_coarse_match import HEIGHT, WIDTH, planes
from tests.core.test_pose_error import RIG, cycles_pair
from tests.core_rigs import every_isa
from tests.reference import matched_views


def board(height: int, width: int, side: int, shift: int = 0) -> np.ndarray:
    """A chessboard with squares of `side` px, under sensor noise."""
    y, x = np.indices((height, width))
    squares = 60 + 120 * ((x + shift) // side + y // side & 1)
    noisy = squares[..., None] + np.random.default_rng(shift).normal(0, 2, (height, width, 3))
    return np.clip(noisy, 0, 255).astype(np.uint8)


@every_isa
@pytest.mark.parametrize("share_of_board", [0.0, 0.4, 1.0])
def test_equals_twin(isa: str, share_of_board: float, restored_settings: None) -> None:
    left, right = shifted_pair(HEIGHT, WIDTH, 9)
    rows = int(share_of_board * HEIGHT)
    left[:rows], right[:rows] = board(rows, WIDTH, 12), board(rows, WIDTH, 12, 9)
    _core.set_isa(isa)
    seen = _core.share_of_rivals(planes(left), planes(right), (WIDTH, HEIGHT))
    assert seen == pytest.approx(matched_views.share_of_rivals(planes(left), planes(right), (WIDTH, HEIGHT)))
    assert seen == pytest.approx(share_of_board, abs=0.15)


def test_flat_and_tiny_views_tell_nothing() -> None:
    flat = np.full((3, HEIGHT + 2, WIDTH), 90, np.uint8)
    for view, picture in ((flat, (WIDTH, HEIGHT)), (flat[:, :8, :8].copy(), (8, 8))):
        assert np.isnan(_core.share_of_rivals(view, view, picture))


def test_frames_of_patterns_are_named() -> None:
    left, right = cycles_pair(5)
    height, width = left.shape[:2]
    pattern = board(height, width, 40), board(height, width, 40, 60)
    upper = [
        np.vstack([part[: height * 2 // 3], view[height * 2 // 3 :]])
        for part, view in zip(pattern, (left, right), strict=True)
    ]
    with DepthEstimator("fast", calibration=RIG) as estimator:
        clean = estimator.predict(left, right)
        whole = estimator.predict(*pattern)
        part = estimator.predict(*upper)
    assert Cause.REPEATED_PATTERN not in clean.causes and clean.measures[Cause.REPEATED_PATTERN] < 0.3
    assert whole.status == Status.INVALID and whole.causes[Cause.REPEATED_PATTERN] > 0.9
    assert part.status == Status.DEGRADED and 0.5 <= part.causes[Cause.REPEATED_PATTERN] < 0.9
