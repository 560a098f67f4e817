"""Depth edges and flying pixels on maps whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.evaluation.edges import depth_edges, flying_pixels, near_edges
from endosdk.evaluation.scores import evaluate_pair

NAN = np.nan
STEP = 480  # first column of the foreground


def step(width: int = 960, height: int = 40, background: float = 20.0, foreground: float = 60.0) -> np.ndarray:
    """Background on the left, foreground on the right."""
    truth = np.full((height, width), background, np.float32)
    truth[:, width // 2 :] = foreground
    return truth


def test_a_step_is_an_edge_on_both_sides() -> None:
    edges = depth_edges(step())
    assert np.array_equal(np.flatnonzero(edges[0]), range(STEP - 2, STEP + 2))
    assert (edges == edges[0]).all()
    assert np.array_equal(depth_edges(step(height=960).T), depth_edges(step(height=960)).T)


@pytest.mark.parametrize(("jump", "edge"), [(2.9, False), (3.0, False), (3.1, True)])
def test_an_edge_is_a_jump_over_three_pixels(jump: float, edge: bool) -> None:
    assert depth_edges(step(foreground=20.0 + jump)).any() == edge
    assert near_edges(step(foreground=20.0 + jump)).any() == edge


def test_a_slope_is_no_edge_but_a_ramp_of_two_pixels_is() -> None:
    slope = np.broadcast_to(np.arange(960, dtype=np.float32) * 1.4, (4, 960))
    assert not depth_edges(slope).any()
    assert depth_edges(slope * 1.1).all()
    ramp = step(foreground=24.0)
    ramp[:, STEP] = 22.0
    assert depth_edges(ramp).any()


def test_a_gap_in_the_truth_is_no_edge() -> None:
    truth = step()
    truth[:, STEP - 2 : STEP + 2] = NAN
    assert not depth_edges(truth).any()
    assert not flying_pixels(np.full_like(truth, 40.0), truth).any()


def test_the_band_reaches_eight_pixels_beyond_the_ends() -> None:
    near = near_edges(step())
    assert np.array_equal(np.flatnonzero(near[20]), range(STEP - 10, STEP + 10))
    corner = np.full((960, 960), 20.0, np.float32)
    corner[400, 500] = 60.0
    away = np.hypot(*(np.indices(corner.shape) - np.array([400, 500])[:, None, None]))
    assert near_edges(corner)[away <= 8].all()
    assert not near_edges(corner)[away > 10].any()


def test_edges_are_those_of_the_scene_at_every_size() -> None:
    large, small = step(1920, 40, 40.0, 46.2), step(480, 40, 10.0, 11.55)
    assert np.array_equal(np.flatnonzero(near_edges(large)[20]), range(960 - 20, 960 + 20))
    assert np.array_equal(np.flatnonzero(near_edges(small)[20]), range(240 - 5, 240 + 5))
    assert not near_edges(step(1920, 40, 40.0, 45.8)).any()


def test_answers_between_two_surfaces_fly() -> None:
    truth = step()
    answer = truth.copy()
    answer[:, STEP - 3 : STEP + 3] = 40.0  # a ramp's middle: 20 px from both
    answer[:, 100] = 40.0  # wrong, and far from any edge
    flying = flying_pixels(answer, truth)
    assert np.array_equal(np.flatnonzero(flying[20]), range(STEP - 3, STEP + 3))
    assert flying.sum() == 6 * truth.shape[0]


@pytest.mark.parametrize(
    ("answer", "flies"), [(20.0, False), (22.9, False), (23.1, True), (56.9, True), (57.1, False), (60.0, False)]
)
def test_only_what_is_over_three_pixels_from_both_flies(answer: float, flies: bool) -> None:
    truth = step()
    assert flying_pixels(np.full_like(truth, answer), truth)[20, STEP] == flies


def test_what_lies_before_or_behind_both_surfaces_does_not_fly() -> None:
    truth = step()
    assert not flying_pixels(np.full_like(truth, 5.0), truth).any()
    assert not flying_pixels(np.full_like(truth, 90.0), truth).any()


def test_an_edge_out_of_place_does_not_fly() -> None:
    truth = step()
    assert not flying_pixels(np.roll(truth, 5, axis=1)[:, 10:-10], truth[:, 10:-10]).any()


def test_a_third_surface_is_a_surface() -> None:
    truth = step()
    truth[:, STEP - 4 : STEP] = 40.0
    assert not flying_pixels(truth, truth).any()
    assert not flying_pixels(np.full_like(truth, 40.0), truth)[20, STEP - 10 : STEP + 10].any()
    assert flying_pixels(np.full_like(truth, 50.0), truth)[20, STEP]


def test_pixels_without_truth_or_answer_do_not_fly() -> None:
    truth = step()
    truth[5, STEP] = NAN
    answer = np.full_like(truth, 40.0)
    answer[6, STEP] = NAN
    flying = flying_pixels(answer, truth)
    assert not flying[5, STEP] and not flying[6, STEP] and flying[7, STEP]


def test_shapes_must_agree() -> None:
    with pytest.raises(InvalidArgument, match="disparity: must have the shape of the truth"):
        flying_pixels(np.ones((4, 5)), np.ones((4, 6)))


def test_the_score_of_a_pair_reports_its_edges() -> None:
    truth = step()
    answer = truth + np.float32(0.5)
    answer[:, STEP - 1 : STEP + 1] = 40.0
    score = evaluate_pair(answer, truth)["edges"]
    assert score["pixels"] == 20 * truth.shape[0]
    assert score["epe_px"] == pytest.approx((18 * 0.5 + 2 * 20.0) / 20)
    assert score["flying"] == pytest.approx(2 / 20)
    assert "flying" not in evaluate_pair(answer, truth)["all"]
    flat = evaluate_pair(truth[:, :400], truth[:, :400])["edges"]
    assert flat["pixels"] == 0 and flat["epe_px"] is None and flat["flying"] is None
