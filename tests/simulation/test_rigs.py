"""Rigs that are drawn for every scene: within what people own, and as far and as near as a set shall reach."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.effects import Effects
from endosdk.simulation.recipe import Recipe
from endosdk.simulation.rigs import (
    BASELINE_MM,
    FARTHEST_MM,
    FOCAL_SHARE,
    MEASURED,
    NEAREST_MM,
    ORGAN_SPANS,
    SceneRig,
    Spans,
    draw_camera,
    draw_range,
)


def drawn(seed: int, height: int | None = None, spans: Spans = ORGAN_SPANS) -> SceneRig:
    rng = np.random.default_rng(seed)
    return draw_range(rng, *draw_camera(rng, 480, height), largest=120.0, spans=spans)


def test_rigs_cover_the_bounds_and_stay_in_them() -> None:
    rigs = [drawn(seed) for seed in range(600)]
    focal = np.array([rig.camera.focal_px / 480 for rig in rigs])
    baseline = np.array([rig.camera.baseline_mm for rig in rigs])
    for values, (low, high) in ((focal, FOCAL_SHARE), (baseline, BASELINE_MM)):
        assert low <= values.min() < low + 0.05 * (high - low)
        assert high >= values.max() > high - 0.05 * (high - low)
    for share, mm in MEASURED:  # and every measured rig has neighbours
        assert ((np.abs(focal / share - 1) < 0.08) & (np.abs(baseline / mm - 1) < 0.08)).sum() >= 10
    assert {rig.camera.height for rig in rigs} == {360, 384, 270}
    assert {rig.span for rig in rigs} == set(ORGAN_SPANS)
    middle = np.array([[(rig.camera.width - 1) / 2, (rig.camera.height - 1) / 2] for rig in rigs])
    away = np.abs(np.array([rig.centre for rig in rigs]) - middle)
    assert np.median(away) > 5
    assert away[:, 0].max() < 0.07 * 480


def test_a_rig_looks_no_nearer_than_it_may() -> None:
    for seed in range(200):
        rig = drawn(seed, 360)
        product = rig.camera.focal_px * rig.camera.baseline_mm
        assert 0 < rig.farthest < rig.nearest <= min(120.0, product / NEAREST_MM) * 1.0001
        assert product / rig.farthest < FARTHEST_MM * 1.01
    nearest = [drawn(seed).nearest for seed in range(200)]
    assert max(drawn(seed).limit for seed in range(200)) == 120
    assert max(nearest) > 0.9 * 120
    assert min(nearest) < 0.1 * 120


def test_the_two_views_share_the_principal_point_that_was_drawn() -> None:
    rig = drawn(3)
    pair = rig.pair()
    np.testing.assert_array_equal(pair.left.matrix, pair.right.matrix)
    assert tuple(pair.left.matrix[:2, 2]) == rig.centre
    assert pair.right.translation[0] == -rig.camera.baseline_mm


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("aspect", {"aspect": "wide"}),
        ("aspect", {"aspect": "drawn"}),
        ("faults", {"faults": True, "rig": "raw"}),
        ("faults", {"faults": True, "frames": 3}),
        ("renderer", {"organ": "shapes", "renderer": "cycles"}),
        ("organ", {"organ": "shapes", "rig": "raw"}),
        ("organ", {"organ": "shapes", "frames": 2}),
        ("organ", {"organ": "lap", "rig": "raw"}),
        ("organ", {"organ": "lap", "frames": 2}),
        ("effects", {"organ": "shapes", "effects": Effects(chroma=True)}),
    ],
)
def test_settings_that_do_not_go_together_are_named(name: str, settings: dict[str, object]) -> None:
    with pytest.raises(InvalidArgument, match=f"^{name}: "):
        Recipe(**settings)  # type: ignore[arg-type]


def test_what_came_later_leaves_older_recipes_as_they_were() -> None:
    assert not {"aspect", "faults"} & set(Recipe().described())
    later = Recipe(rig="drawn", aspect="drawn", faults=True, camera=StereoCamera()).described()
    assert later["aspect"] == "drawn"
    assert later["faults"] is True
