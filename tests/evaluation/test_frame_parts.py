"""Parts of a view that are hard to match, on pictures whose parts are known."""

from __future__ import annotations

import numpy as np

from endosdk.evaluation.frame_parts import (
    BLOWN_OUT,
    HALO,
    TEXTURE_WINDOW,
    glare,
    has_instruments,
    instrument_edges,
    low_texture,
)
from endosdk.evaluation.scores import evaluate_pair

HEIGHT, WIDTH = 60, 960
SKIN, STEEL = (180, 90, 80), (120, 118, 124)


def flat(colour: tuple[int, int, int] = SKIN) -> np.ndarray:
    view = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    view[:] = colour
    return view


def textured(seed: int = 0) -> np.ndarray:
    coarse = np.random.default_rng(seed).integers(-30, 30, (HEIGHT // 5, WIDTH // 5, 1))
    return (flat() + np.kron(coarse, np.ones((5, 5, 1)))).astype(np.uint8)


def test_glare_is_where_all_channels_are_blown_out_and_a_little_around() -> None:
    view = flat()
    view[30, 400] = BLOWN_OUT
    view[30, 700] = (255, 255, BLOWN_OUT - 1)
    found = glare(view)
    reach = int(HALO)
    rows, columns = np.nonzero(found)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (30 - reach, 30 + reach, 400 - reach, 400 + reach)


def test_low_texture_is_where_brightness_is_the_same_all_around() -> None:
    view = textured()
    assert not low_texture(view).any()
    view[:, :480] = SKIN
    found = low_texture(view)
    assert found[:, 10:465].all() and not found[:, 490:].any()
    noise = np.random.default_rng(1).normal(0, 1.0, view.shape)
    assert low_texture((view + noise).clip(0, 255).astype(np.uint8))[:, 20:460].mean() > 0.95
    view[20:40, 100:200] = 255  # flat as well, but that is glare
    assert not low_texture(view)[20:40, 100:200].any()


def test_the_window_of_low_texture_is_as_wide_as_it_says() -> None:
    view = flat()
    view[:, 500:] = textured()[:, 500:]
    view[:, 500:502] = 0  # so that one column of it is enough
    found = low_texture(view)[HEIGHT // 2]
    # Brightness is first averaged over three pixels, which brings the border one pixel nearer.
    assert found[: 500 - 1 - TEXTURE_WINDOW // 2].all() and not found[500 - 1 - TEXTURE_WINDOW // 2 : 502].any()


def test_edges_of_instruments_have_metal_in_front() -> None:
    view, truth = flat(), np.full((HEIGHT, WIDTH), 20.0, np.float32)
    truth[:, 300:400] = truth[:, 600:700] = 50.0
    view[:, 300:400] = STEEL  # the other is tissue in front of tissue
    found = instrument_edges(view, truth)
    assert found[:, [295, 300, 399, 405]].all() and not found[:, 500:].any() and not found[:, 350].any()
    # Metal behind tissue makes no edge of an instrument.
    view[:] = STEEL
    view[:, 300:400] = view[:, 600:700] = SKIN
    assert not instrument_edges(view, truth).any()


def test_parts_are_scored_apart_and_no_pixel_is_in_glare_and_low_texture() -> None:
    view, truth = textured(), np.full((HEIGHT, WIDTH), 20.0, np.float32)
    view[:, :480] = SKIN
    view[:, :100] = 255
    disparity = truth + np.where(np.arange(WIDTH) < 100, 3.0, np.where(np.arange(WIDTH) < 480, 1.0, 0.0))
    disparity = disparity.astype(np.float32)
    scores = evaluate_pair(disparity, truth, view=view, instruments=True)
    assert scores["glare"]["epe_px"] > 2.9 and 0.9 < scores["low_texture"]["epe_px"] < 1.1
    assert scores["glare"]["pixels"] + scores["low_texture"]["pixels"] < scores["all"]["pixels"]
    assert scores["instrument_edges"]["pixels"] == 0 and scores["instrument_edges"]["epe_px"] is None
    assert "glare" not in evaluate_pair(disparity, truth)


def test_noise_is_how_much_the_error_bends_away_from_edges() -> None:
    truth = np.full((HEIGHT, WIDTH), 20.0, np.float32)
    tilted = truth + np.linspace(0, 5, WIDTH, dtype=np.float32)
    assert evaluate_pair(tilted, truth)["all"]["noise_px"] < 1e-4  # wrong, but smooth
    alternating = (truth + np.where(np.arange(WIDTH) % 2, 0.5, 0.0)).astype(np.float32)
    assert np.isclose(evaluate_pair(alternating, truth)["all"]["noise_px"], 1.0)
    truth[:, 480:] = 60.0
    assert evaluate_pair(np.full_like(truth, 20.0), truth)["all"]["noise_px"] == 0.0  # the jump is at an edge


def test_records_of_ours_say_whether_there_is_an_instrument() -> None:
    assert has_instruments({"tools": ["grasper"], "scene": {"instrument": None}})
    assert has_instruments({"scene": {"instrument": {"tip": [0.5, 0.5]}}})
    assert not has_instruments({"tools": [], "scene": {"instrument": None}})
    assert not has_instruments({}) and not has_instruments({"layout": "scared"})
