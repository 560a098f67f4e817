"""What is wrong with a pair has the same name, the same measure and the same status in C as in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from endosdk import Cause, DepthEstimator
from endosdk.runtime.models import shipped_models
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL, shifted_pair
from tests.core.test_causes import SIZE, SPOILT
from tests.core.test_pose_error import RIG, cycles_pair, turned

Pair = tuple[np.ndarray, np.ndarray]

# Of a rendered pair, whose faults the small model of the tests cannot see.
RENDERED: dict[str, tuple[Callable[[np.ndarray, np.ndarray], Pair], Cause]] = {
    "the cables exchanged": (lambda left, right: (right, left), Cause.SWAPPED),
    "one view 24 rows lower": (lambda left, right: (left, np.roll(right, 24, axis=0)), Cause.NOT_RECTIFIED),
}


def told_by_both(library: Any, model: Any, rig: Any, pair: Pair, min_confidence: float) -> set[Cause]:
    with DepthEstimator(model, calibration=rig, min_confidence=min_confidence) as python:
        wanted = python.predict(*pair)
    estimator = c.CEstimator(library, model, rig, min_confidence=min_confidence)
    result, _ = estimator.predict(*pair, maps=("disparity",))
    estimator.close()
    assert result.quality == wanted.status
    assert result.causes == sum(1 << cause for cause in wanted.causes)
    measured = {cause: measure for cause, measure in enumerate(result.measures) if not np.isnan(measure)}
    assert measured == pytest.approx(wanted.measures, rel=1e-6)
    return set(wanted.causes)


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_pair_has_the_causes_that_python_names(library, name):
    spoil, cause, _ = SPOILT[name]
    told = told_by_both(library, TINY_MODEL, None, spoil(*shifted_pair(*SIZE, 9)), 0.3)
    assert told == set() if cause is None else cause in told


@pytest.mark.parametrize("name", RENDERED)
def test_exchanged_views_and_rows_that_are_off_are_named_as_in_python(library, name):
    spoil, cause = RENDERED[name]
    assert cause in told_by_both(library, shipped_models()["fast-320"], RIG, spoil(*cycles_pair(5)), 0.7)


def test_a_view_that_is_a_frame_late_is_named_as_in_python(library):
    """A rig that nods: the right view is that of the frame before."""
    views = cycles_pair(2)
    nods = [
        [turned(view, (0.9 * np.sin(0.45 * k), 0.7 * np.sin(0.3 * k + 1), 0.0)) for view in views] for k in range(14)
    ]
    pairs = [(nods[k][0], nods[k - 1][1]) for k in range(1, len(nods))]
    model = shipped_models()["fast-320"]
    with DepthEstimator(model, calibration=RIG) as python:
        wanted = [python.predict(*pair) for pair in pairs]
    estimator = c.CEstimator(library, model, RIG)
    told = [estimator.predict(*pair, maps=("disparity",))[0].causes for pair in pairs]
    estimator.close()
    assert told == [sum(1 << cause for cause in result.causes) for result in wanted]
    assert told[-1] & 1 << Cause.NOT_SIMULTANEOUS
