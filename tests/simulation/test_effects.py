"""Effects that are off unless asked for; the settings that determine a set, and what they refuse."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import Pose
from endosdk.simulation.effects import Effects, affected, subsample_chroma, turning
from endosdk.simulation.recipe import Recipe
from endosdk.simulation.scene import draw_scene
from endosdk.simulation.sensor import expose

HERE = Pose(np.array([1.0, 2.0, 3.0]), np.eye(3))


def test_no_motion_is_one_instant() -> None:
    assert turning(HERE, 0.0, 400.0, 1) == (HERE,)


def test_a_turning_hand_leaves_a_streak_no_longer_than_asked_for() -> None:
    for seed in range(10):
        poses = turning(HERE, 6.0, 400.0, seed)
        assert 2 <= len(poses) <= 8
        turn = poses[0].axes @ poses[-1].axes.T
        angle = np.arccos((np.trace(turn) - 1) / 2)
        assert 0.15 * 6.0 < angle * 400.0 <= 6.01
        np.testing.assert_allclose(np.mean([pose.axes for pose in poses], axis=0), np.eye(3), atol=1e-3)


def test_chroma_is_shared_by_four_pixels_and_brightness_is_not() -> None:
    picture = np.random.default_rng(1).integers(40, 216, (32, 32, 3), np.uint8)
    coded = subsample_chroma(picture)
    weights = np.array([0.299, 0.587, 0.114])
    assert np.abs(coded.astype(float) @ weights - picture.astype(float) @ weights).mean() < 3
    spread = [np.std(p[..., 0].astype(float) - p[..., 2]) for p in (picture, coded)]
    assert spread[1] < 0.6 * spread[0]


def test_settings_that_came_later_do_not_change_older_sets() -> None:
    assert not {"effects", "frames"} & set(Recipe().described())
    chroma = Recipe(effects=Effects(chroma=True)).described()["effects"]
    assert chroma == {"motion_px": 0.0, "shutter": 0.0, "chroma": True}
    assert Recipe(effects=Effects(bubbles=True)).described()["effects"]["bubbles"] is True


@pytest.mark.parametrize("organ", ["intestine", "abdomen"])
def test_a_single_lamp_and_bubbles_change_nothing_else(organ: str) -> None:
    scene = draw_scene(5, organ)
    assert affected(scene, Effects()) is scene
    lit = affected(scene, Effects(emitters=1))
    assert len(set(lit.lamp.emitters)) == 1
    assert replace(lit, lamp=scene.lamp) == scene
    foamy = affected(scene, Effects(bubbles=True))
    kinds = {part.tissue.kind for part in foamy.parts if part.tissue.bubbles}
    assert kinds == {part.tissue.kind for part in scene.parts} & {"colon", "gastric", "duct"}
    assert bool(kinds) == (organ == "intestine")
    plain = tuple(replace(part, tissue=replace(part.tissue, bubbles=0.0)) for part in foamy.parts)
    assert replace(foamy, parts=plain) == scene


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("vignetting", {"vignette"}),
        ("glare", {"glare"}),
        ("exposure_difference", {"gain_difference", "tint_difference"}),
        ("noise", {"noise", "shot_noise"}),
        ("compression", {"jpeg_quality"}),
    ],
)
def test_a_fault_of_the_chips_can_be_left_out_alone(effect: str, values: set[str]) -> None:
    scene = next(s for s in (draw_scene(seed, "gi") for seed in range(9)) if s.sensor.jpeg_quality)
    clean = affected(scene, Effects(**{effect: False}))
    before, after = asdict(scene.sensor), asdict(clean.sensor)
    assert {name for name in before if before[name] != after[name]} == values
    assert not np.any(np.concatenate([np.atleast_1d(after[name]) for name in values]))
    assert replace(clean, sensor=scene.sensor) == scene
    assert Recipe(effects=Effects(**{effect: False})).described()["effects"][effect] is False


def test_without_their_faults_both_chips_give_the_same_picture_of_the_same_light() -> None:
    light = np.random.default_rng(3).random((64, 96, 3), np.float32)
    scene = draw_scene(5, "gi")
    same_lens = replace(scene.sensor, blur_difference_px=0.0)
    clean = affected(
        replace(scene, sensor=same_lens), Effects(vignetting=False, exposure_difference=False, noise=False)
    ).sensor
    left, right = expose(light, light, clean, (1,))
    np.testing.assert_array_equal(left, right)
    left, right = expose(light, light, same_lens, (1,))
    assert np.abs(left.astype(float) - right).mean() > 0.5


@pytest.mark.parametrize(
    "values", [{"motion_px": -1.0}, {"motion_px": 51.0}, {"shutter": 1.1}, {"shutter": -0.1}, {"emitters": 3}]
)
def test_impossible_effects_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InvalidArgument, match=f"^{next(iter(values))}: "):
        Effects(**values)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("frames", {"frames": -1}),
        ("rig", {"frames": 3, "rig": "raw"}),
        ("motion_px", {"frames": 3, "effects": Effects(motion_px=2.0)}),
        ("shutter", {"effects": Effects(shutter=0.5)}),
    ],
)
def test_settings_that_exclude_each_other_are_named(name: str, settings: dict[str, object]) -> None:
    with pytest.raises(InvalidArgument, match=f"^{name}: "):
        Recipe(**settings)  # type: ignore[arg-type]
