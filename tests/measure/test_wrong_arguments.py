"""What cannot be measured is refused for what it is."""

from __future__ import annotations

import re
from typing import Any, cast

import numpy as np
import pytest

from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.measure import (
    RawLeftView,
    area,
    distance,
    path_length,
    point_at,
    q_matrix,
    raw_to_rectified,
    rectified_to_raw,
    valid_region,
)
from endosdk.runtime.rectify import rectified
from tests.conftest import TINY_MODEL, shifted_pair

RIG = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))


@pytest.fixture(scope="module")
def result() -> DepthResult:
    return DepthEstimator(str(TINY_MODEL), calibration=RIG).predict(*shifted_pair(96, 160, 12))


@pytest.mark.parametrize("seen", [None, RIG])
def test_what_is_no_result_is_named(seen: Any) -> None:
    said = rf"^result: must be a DepthResult; got {type(seen).__name__} \["
    with pytest.raises(InvalidArgument, match=said):
        point_at(seen, 3, 3)
    with pytest.raises(InvalidArgument, match=said):
        distance(seen, (3, 3), (9, 9))
    with pytest.raises(InvalidArgument, match=said):
        area(seen, [(3, 3), (30, 3), (3, 30)])


@pytest.mark.parametrize("seen", [None, "rig.json"])
def test_what_is_no_calibration_is_named(result: DepthResult, seen: Any) -> None:
    black = np.zeros((96, 160, 3), np.uint8)
    for call in (
        lambda: RawLeftView(seen),
        lambda: raw_to_rectified(seen, (1, 2)),
        lambda: rectified_to_raw(seen, (1, 2)),
        lambda: valid_region(seen),
        lambda: q_matrix(seen),
        lambda: rectified(black, black, seen),
        lambda: DepthEstimator(str(TINY_MODEL), calibration=seen or 1),
    ):
        with pytest.raises(
            InvalidArgument, match=r"^calibration: must be a StereoCalibration; got (NoneType|str|int) "
        ):
            call()
    with pytest.raises(InvalidArgument, match=r"^result: must be a DepthResult; got (NoneType|str) "):
        RawLeftView(RIG).depth(seen)


def test_what_is_no_pixel_is_shown(result: DepthResult) -> None:
    wrong: Any
    for wrong, said in (
        (("a", 3), "x: must be a number, px; got 'a'"),
        ((3, None), "y: must be a number, px; got None"),
    ):
        with pytest.raises(InvalidArgument, match=f"^{said} "):
            point_at(result, *wrong)
    for wrong, seen in (([(1, 2), (3, "b")], "[(1, 2), (3, 'b')]"), ([1, 2], "shape (2,)"), (None, "None")):
        with pytest.raises(InvalidArgument, match=rf"^pixels: must be a list of \(x, y\); got {re.escape(seen)} \["):
            path_length(result, wrong)
    with pytest.raises(InvalidArgument, match=r"^polygon: must be a list of \(x, y\); got 'abc' \["):
        area(result, cast(Any, "abc"))
