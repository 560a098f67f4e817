"""Views of two moments: the line through rows and motion against NumPy, and a rig that shakes."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk import DepthEstimator, _core
from endosdk.errors import InvalidArgument
from tests.core.test_pose_error import RIG, cycles_pair, turned

FADING = 1 - 1 / 90  # per frame
FRAMES = 18
FIRST = 9  # frame that can be named: docs/trust.md


def test_the_line_is_that_of_numpy() -> None:
    rng = np.random.default_rng(1)
    moved = rng.normal(0, 3, 40)
    rows = 0.7 + 0.8 * moved + rng.normal(0, 0.2, 40)
    lag, error = _core.lag_of(moved, rows)
    weights = FADING ** np.arange(39, -1, -1)
    line = np.polyfit(moved, rows, 1, w=np.sqrt(weights))
    assert lag == pytest.approx(line[0], rel=1e-9)
    left = np.sum(weights * (rows - np.polyval(line, moved)) ** 2) / (weights.sum() - 2)
    spread = np.sum(weights * (moved - np.average(moved, weights=weights)) ** 2)
    assert error == pytest.approx(np.sqrt(4 * (left + 0.05**2) / spread), rel=1e-9)
    with pytest.raises(InvalidArgument, match="rows_px"):
        _core.lag_of(moved, rows[1:])


@pytest.fixture(scope="module")
def shaken() -> list[tuple[np.ndarray, np.ndarray]]:
    """A still scene seen by a rig that nods and sways, by about 3 px a frame."""
    left, right = cycles_pair(2)
    angles = [(0.9 * np.sin(0.45 * k), 0.7 * np.sin(0.3 * k + 1), 0.3 * np.sin(0.5 * k)) for k in range(FRAMES)]
    return [(turned(left, angle), turned(right, angle)) for angle in angles]


@pytest.mark.parametrize(("left_late", "right_late"), [(0, 0), (0, 1), (1, 0)])
@pytest.mark.parametrize("calibrated", [True, False])
def test_a_late_view_is_named(
    shaken: list[tuple[np.ndarray, np.ndarray]], left_late: int, right_late: int, calibrated: bool
) -> None:
    pairs = [(shaken[k - left_late][0], shaken[k - right_late][1]) for k in range(1, FRAMES)]
    with DepthEstimator("fast", calibration=RIG if calibrated else None) as depth:
        if calibrated:
            answers = [depth.predict(*pair) for pair in pairs]
        else:
            answers = list(depth.stream(pairs))
    told = [answer.causes.get(_core.Cause.NOT_SIMULTANEOUS) for answer in answers]
    known = [_core.Cause.NOT_SIMULTANEOUS in answer.measures for answer in answers]
    assert known == [number >= FIRST for number in range(1, FRAMES)]
    if left_late or right_late:
        since = answers[FIRST - 1 :]
        assert told[: FIRST - 1] == [None] * (FIRST - 1)
        assert all(measure is not None and 1 < measure < 8 for measure in told[FIRST - 1 :])
        assert not any({_core.Cause.RIG_MOVED, _core.Cause.NOT_RECTIFIED} & set(answer.causes) for answer in since)
        assert {answer.status.name for answer in since} == {"DEGRADED"}
    else:
        assert not any(told)


def test_a_frame_without_an_answer_stays_invalid_when_it_turns_out_to_be_late() -> None:
    left, right = cycles_pair(2)
    angles = [(2.7 * np.sin(0.6 * k), 0.0, 0.0) for k in range(FRAMES)]
    pairs = [(turned(left, angles[k]), turned(right, angles[k - 1])) for k in range(1, FRAMES)]
    with DepthEstimator("fast") as depth:
        answers = [depth.predict(*pair) for pair in pairs]
    late = [answer for answer in answers if _core.Cause.NOT_SIMULTANEOUS in answer.causes]
    assert any(answer.status.name == "INVALID" for answer in late)
    for answer in answers:
        assert (answer.status.name == "INVALID") == (answer.valid_share == 0.0) == (answer.reasons != 0).all()
