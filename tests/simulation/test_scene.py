"""A scene is a function of its seed, and knows no renderer."""

from __future__ import annotations

import subprocess
import sys
from itertools import islice

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.simulation.curve import bezier
from endosdk.simulation.scene import MIXTURES, ORGANS, candidate_poses, draw_scene
from endosdk.simulation.shapes import Tube


@pytest.mark.parametrize("organ", [*ORGANS, *MIXTURES])
def test_same_seed_gives_the_same_scene(organ: str) -> None:
    assert draw_scene(5, organ) == draw_scene(5, organ)
    assert draw_scene(5, organ) != draw_scene(6, organ)


def test_mix_draws_every_organ() -> None:
    for mixture, shares in MIXTURES.items():
        assert {draw_scene(seed, mixture).organ for seed in range(40)} == set(shares)


def test_same_scene_gives_the_same_poses() -> None:
    first, again = (list(islice(candidate_poses(draw_scene(3, "intestine")), 4)) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.axes, other.axes)
    assert not np.array_equal(first[0].position, first[1].position)


def test_pose_axes_are_a_rotation() -> None:
    poses = list(islice(candidate_poses(draw_scene(3, "stomach")), 8))
    assert len(poses) == 8
    for pose in poses:
        np.testing.assert_allclose(pose.axes @ pose.axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose.axes) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(6))
def test_camera_in_a_gut_stays_well_inside_its_wall(seed: int) -> None:
    scene = draw_scene(seed, "intestine")
    wall = scene.parts[0].shape
    assert isinstance(wall, Tube)
    axis = bezier(np.asarray(wall.control), np.linspace(0, 1, 400))
    for pose in islice(candidate_poses(scene), 20):
        assert np.linalg.norm(axis - pose.position, axis=1).min() <= 0.41 * wall.radius


@pytest.mark.parametrize(("seed", "organ", "argument"), [(1, "liver", "organ"), (-1, "mix", "seed")])
def test_bad_input_is_named(seed: int, organ: str, argument: str) -> None:
    with pytest.raises(InvalidArgument, match=f"^{argument}: "):
        draw_scene(seed, organ)


def test_drawing_a_scene_loads_no_renderer() -> None:
    program = (
        "import sys; from endosdk.simulation.scene import draw_scene; draw_scene(1, 'mix');"
        "print(*{'moderngl', 'bpy', 'torch', 'cv2'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
