"""Both cameras are inside the lumen and outside every organ, wherever they are put and wherever a video takes them."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from endosdk.simulation.meshes import Mesh, build_mesh
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.sample import DisparityLimits, load_scene, place_camera
from endosdk.simulation.scene import ORGANS, candidate_poses, draw_scene
from endosdk.simulation.stereo_video import draw_flight
from tests.simulation.conftest import SMALL


def winding(mesh: Mesh, point: np.ndarray) -> float:
    """How often a closed mesh goes around a point: 1 inside, 0 outside (solid angles of Van Oosterom and Strackee)."""
    a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) - point for k in range(3))
    x, y, z = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(1)
    flat = x * y * z + (a * b).sum(1) * z + (b * c).sum(1) * x + (c * a).sum(1) * y
    return abs(float(np.arctan2(volume, flat).sum())) / (2 * np.pi)


def test_winding_tells_inside_from_outside() -> None:
    wall = draw_scene(1, "stomach").parts[0]
    mesh = build_mesh(wall.shape, (wall.seed, 0))
    assert winding(mesh, np.zeros(3)) == pytest.approx(1.0, abs=1e-3)
    assert winding(mesh, np.array([0.0, 0.0, 500.0])) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("organ", ORGANS)
@pytest.mark.parametrize("seed", [3, 4])
def test_cameras_stay_inside_the_lumen_and_outside_the_organs(renderer: Rasteriser, organ: str, seed: int) -> None:
    scene = draw_scene(seed, organ)
    load_scene(renderer, scene, SMALL, painted=False)
    placed = place_camera(renderer, scene, SMALL, DisparityLimits(0.5, 17.5))
    right = placed.pose.position + placed.pose.axes[0] * SMALL.baseline_mm / placed.scale
    flight = draw_flight(scene, 50, 0)
    positions = [placed.pose.position, right]
    positions += [pose.position for pose in islice(candidate_poses(scene), 4)]
    positions += [flight.pose(frame).position for frame in (0, 25, 49)]
    lumens = [build_mesh(part.shape, (part.seed, 0)) for part in scene.parts if part.shape.inside]
    organs = [build_mesh(part.shape, (part.seed, 0)) for part in scene.parts if not part.shape.inside]
    for position in positions:
        assert max(winding(mesh, position) for mesh in lumens) > 0.99
        assert all(winding(mesh, position) < 0.01 for mesh in organs)
