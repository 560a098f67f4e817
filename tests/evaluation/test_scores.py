"""Pooling of pairs, and agreement of the pooled numbers with the single measures."""

from __future__ import annotations

import json

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.evaluation import metrics
from endosdk.evaluation.edges import depth_edges
from endosdk.evaluation.scores import ScoreBoard, evaluate_pair

FOCAL, BASELINE, DOFFS = 1000.0, 5.0, 3.0


def noisy_pair(seed: int, height: int = 40, width: int = 50) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(20, 60, (height, width)).astype(np.float32)
    scale = rng.uniform(0.2, 3, truth.shape)
    disparity = (truth + rng.laplace(scale=scale)).astype(np.float32)
    truth[rng.random(truth.shape) < 0.1] = np.nan
    disparity[rng.random(truth.shape) < 0.1] = np.nan
    depth = FOCAL * BASELINE / (disparity + DOFFS)
    return {
        "disparity": disparity,
        "truth": truth,
        "occlusion": rng.random(truth.shape) < 0.2,
        "sigma": (depth**2 / (FOCAL * BASELINE) * np.sqrt(2) * scale).astype(np.float32),
        "confidence": np.exp(-scale).astype(np.float32),
    }


def camera() -> dict[str, float]:
    return {"focal_px": FOCAL, "baseline_mm": BASELINE, "doffs": DOFFS}


def test_one_pair_equals_the_single_measures() -> None:
    pair = noisy_pair(0)
    score = evaluate_pair(**pair, **camera())
    disparity, truth = pair["disparity"].astype(float), pair["truth"].astype(float)
    depth, true_depth = (FOCAL * BASELINE / (d + DOFFS) for d in (disparity, truth))
    for region, mask in (("all", None), ("non_occluded", ~pair["occlusion"]), ("occluded", pair["occlusion"])):
        seen = score[region]
        assert seen["epe_px"] == pytest.approx(metrics.end_point_error(disparity, truth, mask))
        assert seen["coverage"] == pytest.approx(metrics.coverage(disparity, truth, mask))
        for k in (1, 2, 3, 5):
            assert seen[f"kpe_{k}"] == pytest.approx(metrics.k_pixel_error(disparity, truth, k, mask))
        assert seen["depth_mae_mm"] == pytest.approx(metrics.depth_error(depth, true_depth, mask))
        assert seen["depth_relative"] == pytest.approx(metrics.relative_depth_error(depth, true_depth, mask))
        known = metrics.compared(disparity, truth, mask)
        errors = np.abs(disparity - truth)[known]
        uncertainty = 1 - pair["confidence"][known]
        ranked = region in ("all", "non_occluded")
        assert ("ause" in seen) == ranked
        if ranked:
            assert seen["ause"] == pytest.approx(metrics.sparsification_error(errors, uncertainty))
        gap = metrics.sigma_calibration_error(np.abs(depth - true_depth)[known], pair["sigma"][known])
        assert seen["sigma_ece_mm"] == pytest.approx(gap)
        assert seen["valid"] == known.sum() and seen["pixels"] == metrics.with_truth(truth, mask).sum()


@pytest.mark.parametrize("missing", [np.inf, -np.inf])
def test_infinity_is_no_answer_and_no_truth(missing: float) -> None:
    """As in maps of the Middlebury format; also when depth is scored, where it would be a point at the lens."""
    pair = noisy_pair(3)
    pair["truth"][:, :4], pair["disparity"][:, -4:] = np.nan, np.nan
    replaced = {
        name: np.where(np.isnan(given), np.float32(missing), given) if name in ("truth", "disparity") else given
        for name, given in pair.items()
    }
    assert evaluate_pair(**replaced, **camera()) == evaluate_pair(**pair, **camera())
    np.testing.assert_array_equal(depth_edges(replaced["truth"]), depth_edges(pair["truth"]))


def test_pairs_are_pooled_by_pixels_not_by_pictures() -> None:
    board = ScoreBoard()
    # 100 pixels wrong by 4 px and 300 wrong by 0: the pooled error is 1 px, the mean of the pictures would be 2.
    board.add(np.full((10, 10), 24.0), np.full((10, 10), 20.0))
    board.add(np.full((10, 30), 20.0), np.full((10, 30), 20.0))
    result = board.result()
    assert result["pairs"] == 2
    assert result["all"]["pixels"] == 400
    assert result["all"]["epe_px"] == pytest.approx(1.0)
    assert result["all"]["kpe_3"] == pytest.approx(0.25)


def test_pooling_equals_one_tall_picture() -> None:
    first, second = noisy_pair(1), noisy_pair(2)
    board = ScoreBoard()
    board.add(**first, **camera())
    board.add(**second, **camera())
    tall = evaluate_pair(**{name: np.vstack([first[name], second[name]]) for name in first}, **camera())
    for region in ("all", "non_occluded"):
        pooled = board.result()[region]
        for name, value in tall[region].items():
            if name != "ause":
                assert pooled[name] == pytest.approx(value), name


def test_parts_are_scored_by_themselves() -> None:
    truth = np.array([[10.0, 20.0, 30.0, 40.0, np.nan]])
    disparity = truth + np.array([[0.0, 1.0, 2.0, 6.0, 0.0]])
    valid = np.array([[True, True, True, False, True]])
    score = evaluate_pair(disparity, truth, valid=valid, largest_px=20.0, occlusion=~valid)
    wanted = {"all": 4, "non_occluded": 3, "occluded": 1, "in_range": 2, "valid": 3}
    assert {part: score[part]["pixels"] for part in wanted} == wanted
    assert score["in_range"]["epe_px"] == pytest.approx(0.5)
    assert score["valid"]["share"] == pytest.approx(0.75)
    assert score["valid"]["kpe_3"] == 0.0 and score["occluded"]["kpe_3"] == 1.0


def test_depth_behind_infinity_is_no_depth_answer() -> None:
    truth = np.full((2, 2), 10.0)
    disparity = np.array([[10.0, -3.0], [-5.0, 10.0]])
    score = evaluate_pair(disparity, truth, **camera())["all"]
    assert score["valid"] == 4 and score["depth_pixels"] == 2
    assert score["depth_mae_mm"] == 0.0


def test_measures_without_their_input_are_left_out_and_the_result_is_json() -> None:
    score = evaluate_pair(np.full((2, 2), np.nan), np.full((2, 2), 5.0))
    assert score == json.loads(json.dumps(score, allow_nan=False))
    assert set(score) == {"pairs", "all", "edges"}
    assert score["all"]["coverage"] == 0.0 and score["all"]["epe_px"] is None
    assert not {"depth_mae_mm", "ause", "sigma_ece_mm", "depth_pixels"} & set(score["all"])


def test_sigma_ranks_pixels_when_there_is_no_confidence() -> None:
    truth = np.zeros((1, 100))
    disparity = np.arange(100.0)[None]
    score = evaluate_pair(disparity, truth, sigma=disparity.copy())
    assert score["all"]["ause"] == 0.0


@pytest.mark.parametrize(
    "options",
    [
        {"focal_px": 1.0},
        {"baseline_mm": 1.0},
        {"occlusion": np.zeros((2, 2), np.uint8)},
        {"occlusion": np.zeros((2, 3), bool)},
        {"sigma": np.ones((3, 2))},
        {"confidence": np.ones(2)},
        {"valid": np.ones((2, 2))},
        {"valid": np.ones((3, 2), bool)},
    ],
)
def test_wrong_options_are_refused_and_the_board_stays_usable(options) -> None:
    board = ScoreBoard()
    with pytest.raises(InvalidArgument):
        board.add(np.ones((2, 2)), np.ones((2, 2)), **options)
    assert board.result() == {"pairs": 0}
    board.add(np.ones((2, 2)), np.ones((2, 2)))
    assert board.result()["all"]["epe_px"] == 0.0
