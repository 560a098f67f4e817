"""What is wrong with a frame: the table, each cause from pictures that have it, and the field of view."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import onnxruntime
import pytest

import endosdk
from endosdk import Cause, Reason, Status, _core
from endosdk.commands.cli import main
from endosdk.measure import rectified_to_raw
from tests.conftest import ROOT, TINY_MODEL, noisy, shifted_pair
from tests.core_rigs import every_isa
from tests.reference import matched_views, resampling, view_measures
from tests.rigs import raw_rig

SIZE = (180, 240)


@pytest.fixture(scope="module")
def estimator():
    with endosdk.DepthEstimator(TINY_MODEL, min_confidence=0.3) as opened:  # it is never very sure
        yield opened


def status_of(measures: dict[Cause, float]) -> Status:
    """The documented table, read in Python."""
    worst = Status.OK
    for cause, measure in measures.items():
        fact = _core.cause_facts[cause]
        for level in (Status.DEGRADED, Status.INVALID):
            limit = fact[level.name.lower()]
            if measure >= limit if fact["bad"] == "high" else measure < limit:
                worst = max(worst, level)
    return worst


def circled(
    view: np.ndarray, x: float, y: float, radius: float, level: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """A view whose optics fill a circle, and where [H, W] they do."""
    rows, columns = np.indices(view.shape[:2])
    inside = np.hypot(columns - x, rows - y) < radius
    dark = np.full_like(view, level)
    return noisy(np.where(inside[..., None], np.maximum(view, 40), dark), 1.5, seed), inside


def test_the_table_is_whole_and_in_order():
    assert list(_core.cause_facts) == list(Cause)
    for fact in _core.cause_facts.values():
        assert fact["measure"] and fact["meaning"] and fact["remedy"] and np.isfinite(fact["degraded"])
        worse = fact["invalid"] - fact["degraded"]
        assert np.isnan(worse) or worse == 0 or (worse > 0) == (fact["bad"] == "high")


SPOILT: dict[str, tuple[Any, Cause | None, Status | None]] = {
    "nothing": (lambda left, right: (left, right), None, Status.OK),
    "right black": (lambda left, right: (left, noisy(0 * right + 3, 1, 1)), Cause.COVERED, Status.INVALID),
    "left grey": (lambda left, right: (0 * left + 128, right), Cause.COVERED, Status.INVALID),
    "both white": (lambda left, right: (left | 255, right | 255), Cause.SATURATED, Status.INVALID),
    "right blurred": (lambda left, right: (left, cv2.GaussianBlur(right, (0, 0), 2)), Cause.BLURRED, None),
    "a tenth of the light": (lambda left, right: (left // 10, right // 10), Cause.DIM, None),
    "left twice": (lambda left, right: (left, left), Cause.SAME_VIEW_TWICE, Status.INVALID),
    "left twice with noise": (lambda left, right: (left, noisy(left, 6, 1)), Cause.SAME_VIEW_TWICE, Status.INVALID),
    "nothing to see": (lambda left, right: (0 * left + 90, 0 * right + 90), Cause.LOW_TEXTURE, Status.INVALID),
    "another scene": (lambda left, right: (left, right[::-1].copy()), Cause.VIEWS_DIFFER, Status.INVALID),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_pair_is_told_what_is_wrong_with_it(estimator, name):
    spoil, cause, status = SPOILT[name]
    result = estimator.predict(*spoil(*shifted_pair(*SIZE, 9)))
    assert (set(result.causes) == set()) if cause is None else (cause in result.causes)
    assert result.status == status_of(result.measures)
    assert result.status == status if status is not None else result.status > Status.OK
    assert result.causes.items() <= result.measures.items()


def test_a_frame_that_must_not_be_used_has_no_depth():
    rig = endosdk.StereoCalibration.rectified(210.0, 4.5, SIZE[::-1])
    left, right = shifted_pair(*SIZE, 9)
    with endosdk.DepthEstimator(TINY_MODEL, calibration=rig, min_confidence=0.0) as estimator:
        good = estimator.predict(left, right)
        result = estimator.predict(left, noisy(0 * right + 3, 1, 1))
    assert good.status is Status.OK and np.isfinite(good.depth).any()
    assert result.status is Status.INVALID and result.valid_share == 0
    assert np.isnan(result.depth).all() and np.isnan(result.sigma).all() and not result.confidence.any()
    assert ((result.reasons & Reason.LOW_CONFIDENCE) != 0).all()


def test_the_limit_of_a_turn_falls_with_the_focal_length(capsys, tmp_path):
    assert _core.least_turn_deg(0.2) == _core.least_turn_deg(0.42) == _core.cause_facts[Cause.RIG_MOVED]["degraded"]
    assert _core.least_turn_deg(0.84) == pytest.approx(0.125)
    rig = endosdk.StereoCalibration.rectified(0.84 * 960, 4.1, (960, 720))
    rig.save(tmp_path / "rig.json")
    pair = [str(ROOT / "examples" / "data" / "demo" / f"{side}.png") for side in ("left", "right")]
    main(["doctor", "--pair", *pair, "--calibration", str(tmp_path / "rig.json")])
    assert "(RIG_MOVED from 0.125)" in capsys.readouterr().out


def test_a_late_frame_says_how_late():
    with endosdk.DepthEstimator(TINY_MODEL, deadline_ms=1e-3) as estimator:
        result = estimator.predict(*shifted_pair(*SIZE, 9))
    assert result.late and result.causes[Cause.LATE] > 1 and result.status is Status.DEGRADED


def test_one_view_that_stands_still_is_frozen(estimator):
    frames = [shifted_pair(*SIZE, 9, seed=seed) for seed in range(7)]
    stuck = [list(estimator.stream((left, frames[0][1]) for left, _ in frames))[-1]]
    stuck.append(list(estimator.stream((frames[0][0], right) for _, right in frames))[-1])
    for result in stuck:
        assert result.measures[Cause.FROZEN] == 6 and Cause.FROZEN in result.causes
    assert Cause.FROZEN not in estimator.predict(*frames[3]).causes


def test_each_source_has_its_own_count_of_frames_that_stand_still(estimator):
    frames = [shifted_pair(*SIZE, 9, seed=seed) for seed in range(8)]
    results = []
    for result in estimator.stream((left, frames[0][1]) for left, _ in frames):
        results.append(result)
        estimator.predict(*frames[-1])
    last = results[-1]
    assert last.measures[Cause.FROZEN] == 7 and Cause.FROZEN in last.causes


def test_a_pair_that_stands_still_is_frozen_after_a_while(estimator):
    pair = shifted_pair(96, 160, 9, seed=11)
    counts = [Cause.FROZEN in result.causes for result in estimator.stream([pair] * 27)]
    assert counts == [False] * 25 + [True] * 2


def test_measures_equal_their_twins(estimator):
    left, right = shifted_pair(*SIZE, 9)
    left[:60, :80], right[100:] = 250, cv2.GaussianBlur(right[100:], (0, 0), 1.5)
    right[20:60, 100:200] = 60
    network = onnxruntime.InferenceSession(TINY_MODEL)
    round_ones = circled(left, 120, 90, 85, 9, 1)[0], circled(right, 124, 93, 80, 4, 2)[0]
    for pair in ((left, right), (noisy(left, 5, 1), noisy(right // 2, 3, 2)), round_ones):
        result = estimator.predict(*pair)
        views = [resampling.planar(view, "rgb", *view.shape[:2]) for view in estimator.rectified_pair()]
        fields = [view_measures.seen_cells(view, *view.shape[1:]) for view in views]
        disparity = network.run(None, {"left": views[0][None], "right": views[1][None]})[0][0, 0]
        found = matched_views.placed(disparity, fields, views[0].shape[1:], 1)
        wanted = view_measures.view_measures(*views, *views[0].shape[1:], found)
        seen = {
            "level": Cause.DIM,
            "saturated": Cause.SATURATED,
            "covered": Cause.COVERED,
            "blur": Cause.BLURRED,
        }
        for name, cause in seen.items():
            assert result.measures[cause] == pytest.approx(wanted[name], rel=1e-3, abs=1e-3), name


def test_a_near_surface_with_little_texture_is_not_covered():
    rng = np.random.default_rng(0)
    surface = np.full((720, 1120, 3), 90.0)
    for y, x in rng.integers(0, (680, 1080), (45, 2)):
        surface[y : y + 40, x : x + 40] += rng.normal(0, 25, (40, 40, 1))
    surface = np.clip(cv2.GaussianBlur(surface, (0, 0), 1.0), 0, 255).astype(np.uint8)
    with endosdk.DepthEstimator("fast") as network:
        result = network.predict(surface[:, :960], surface[:, 160:])  # spots lie five tiles away in the right view
        covered = network.predict(surface[:, :960], noisy(np.full((720, 960, 3), 90), 1, 1))
    assert Cause.COVERED not in result.causes and result.measures[Cause.COVERED] < 0.2
    assert Cause.COVERED in covered.causes


@every_isa
def test_every_set_of_kernels_measures_the_same(isa, estimator, restored_settings):
    left, right = shifted_pair(*SIZE, 9)
    right[20:60, 100:200] = 60
    seen = []
    for name in ("plain", isa):
        _core.set_isa(name)
        seen.append(estimator.predict(noisy(left, 3, 1), cv2.GaussianBlur(noisy(right, 3, 2), (0, 0), 1)).measures)
    assert seen[0][Cause.COVERED] > 0 and seen[0][Cause.BLURRED] > 0
    assert seen[0] == seen[1]


@pytest.mark.parametrize(("x", "y", "radius"), [(120, 90, 85), (110, 100, 105), (120, 90, 130)])
def test_a_circle_is_found_and_nothing_outside_is_valid(estimator, x, y, radius):
    left, right = shifted_pair(*SIZE, 9)
    left, inside = circled(left, x, y, radius, 9, 1)
    right, _ = circled(right, x + 2, y - 3, radius, 5, 2)
    result = estimator.predict(left, right)
    view = resampling.planar(estimator.rectified_pair()[0], "rgb", *SIZE)
    cells = view_measures.field_of_view(view_measures.cell_levels(view, *SIZE))
    assert cells is not None
    twin = resampling.resize_bilinear(cells.astype(float), *SIZE, 0.5, 0.5, 1.0) >= 0.999
    np.testing.assert_array_equal((result.reasons & Reason.OUTSIDE_VIEW) == 0, twin)
    assert not (twin & (cv2.dilate(inside.astype(np.uint8), np.ones((5, 5))) == 0)).any()  # to a cell
    assert twin[inside].mean() > 0.98
    deep = cv2.erode((twin & inside).astype(np.uint8), np.ones((9, 25))) > 0
    assert (result.reasons[deep] == 0).mean() > 0.85


def test_a_black_shaft_across_the_picture_is_in_the_view(estimator):
    """The scene goes on behind it, so it is no edge of a field."""
    views = []
    for view, shift in zip(shifted_pair(*SIZE, 9), (0, 20), strict=True):
        view = np.maximum(view, 40)
        corners = np.array([[0, 20], [260 - shift, 80], [260 - shift, 140], [0, 80]])
        views.append(cv2.fillPoly(view, [corners], (6, 6, 6)))
    result = estimator.predict(*views)
    assert not (result.reasons & Reason.OUTSIDE_VIEW).any()
    view = resampling.planar(estimator.rectified_pair()[0], "rgb", *SIZE)
    assert view_measures.field_of_view(view_measures.cell_levels(view, *SIZE)) is None


STATED = {"left_field_of_view": (300, 250, 250, 210), "right_field_of_view": (330, 240, 260, 220)}
STATED_RIGS = {
    "raw": raw_rig(**STATED),
    "rectified": replace(endosdk.StereoCalibration.rectified(520.0, 4.5, (640, 480)), **STATED),
    "moved": replace(endosdk.StereoCalibration.rectified(520.0, 4.5, (640, 480), doffs=8.0), **STATED),
}


@pytest.mark.parametrize("name", STATED_RIGS)
def test_the_field_of_view_that_the_rig_states_is_taken(name):
    """In pictures that show tissue everywhere, and in which none would be found."""
    rig = STATED_RIGS[name]
    pair = shifted_pair(480, 640, 12)
    small: Any = {"network_size": (320, 240)}
    with endosdk.DepthEstimator(TINY_MODEL, calibration=rig, **small) as estimator:
        reasons = estimator.predict(*pair).reasons
    with endosdk.DepthEstimator(TINY_MODEL, calibration=replace(rig, **dict.fromkeys(STATED)), **small) as estimator:
        assert not (estimator.predict(*pair).reasons & Reason.OUTSIDE_VIEW).any()
    rows, columns = 4.0 * np.indices((120, 160))
    raw = rectified_to_raw(rig, np.stack([columns, rows], axis=2))
    x, y, across, down = STATED["left_field_of_view"]
    depth = (1 - np.hypot((raw[..., 0] - x) / across, (raw[..., 1] - y) / down)) * down  # px inside, about
    outside = (reasons[::4, ::4] & Reason.OUTSIDE_VIEW) != 0
    assert outside[depth < -4].all() and not outside[depth > 8].any()


def test_a_stated_field_of_the_right_view_takes_what_it_does_not_show():
    field = (240, 180, 130, 150)
    rig = endosdk.StereoCalibration.rectified(520.0, 4.5, (480, 360))
    pair = shifted_pair(360, 480, 12)
    with endosdk.DepthEstimator(TINY_MODEL, calibration=replace(rig, right_field_of_view=field)) as estimator:
        reasons = estimator.predict(*pair).reasons
    rows, columns = np.indices((360, 480))
    depth = (1 - np.hypot((columns - 12 - field[0]) / field[2], (rows - field[1]) / field[3])) * field[2]
    missing = (reasons & Reason.OUTSIDE_OVERLAP) != 0
    assert missing[depth < -8].mean() > 0.95 and missing[depth > 12].mean() < 0.05


@pytest.mark.parametrize("sigma", [0.0, 2.0])
def test_the_edge_of_the_field_is_no_focus(estimator, sigma):
    """One view soft and the other one sharp at the edge of the field alone, then in the picture as well."""
    smooth, blurred = (
        [cv2.GaussianBlur(view, (0, 0), spread) for view in shifted_pair(*SIZE, 9)] for spread in (3.0, 3.0 + sigma)
    )
    left, _ = circled(smooth[0], 120, 90, 80, 3, 1)
    right, _ = circled(blurred[1], 124, 92, 80, 20, 2)
    assert (Cause.BLURRED in estimator.predict(left, right).causes) == (sigma > 0)


@pytest.mark.parametrize("dark", ["fading corners", "a dark cavity", "a dark frame"])
def test_dark_tissue_is_inside_the_view(estimator, dark):
    left, right = (50 + 0.5 * view for view in shifted_pair(*SIZE, 9))
    rows, columns = np.indices(SIZE)
    if dark == "fading corners":
        light = np.clip(1.2 - np.hypot(columns - 120, rows - 90) / 140, 0.02, 1)
    elif dark == "a dark cavity":
        light = np.clip(np.hypot(columns - 120, rows - 90) / 60, 0.03, 1)
    else:
        light = np.full(SIZE, 0.05)
    pair = [noisy(view * light[..., None], 1, seed) for seed, view in enumerate((left, right))]
    assert not (estimator.predict(*pair).reasons & Reason.OUTSIDE_VIEW).any()


def test_words_beside_the_view_are_outside_it(estimator):
    left, right = shifted_pair(*SIZE, 9)
    views = [circled(view, 120, 90, 80, 6, seed)[0] for seed, view in enumerate((left, right))]
    for view in views:
        cv2.putText(view, "REC 12", (2, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (220, 220, 220), 1)
    result = estimator.predict(*views)
    assert ((result.reasons[:14, :45] & Reason.OUTSIDE_VIEW) != 0).all()
