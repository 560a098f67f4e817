"""Meshes are closed, oriented, metric in their texture coordinates, and the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from endosdk.simulation.junction import join_lumens
from endosdk.simulation.meshes import Mesh, build_mesh
from endosdk.simulation.noise import fractal_tile, space_noise, tile_noise
from endosdk.simulation.shapes import Blob, Rod, Shape, Tube

GUT = Tube(((0, 0, 0), (0, 0, 60), (8, 0, 120), (20, 5, 180)), 20.0, True, fold_spacing=18.0, fold_height=0.3)
SMOOTH = Tube(((0, 0, 0), (0, 0, 50), (0, 0, 100)), 10.0, True, waves=0.0)
STOMACH = Blob((0, 0, 0), (50, 40, 70), (0, 0, 1), True, rugae=12, ruga_height=0.08, outlet=0.3)
LIVER = Blob((10, 5, 90), (40, 30, 25), (-0.1, 0, -1), False)
SHAFT = Rod((0, 0, 0), (30, 10, 5), 3.0, 4.0)
SHAPES = [GUT, STOMACH, LIVER, SHAFT]


def open_edges(mesh: Mesh, tolerance: float) -> int:
    """Edges that belong to one triangle only, after merging vertices in the same place."""
    cells = np.round((mesh.positions - mesh.positions.min(0)) / tolerance).astype(np.int64)
    _, merged = np.unique((cells[:, 0] << 42) + (cells[:, 1] << 21) + cells[:, 2], return_inverse=True)
    triangles = merged[mesh.triangles]
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), 1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges[:, 0] * len(merged) + edges[:, 1], return_counts=True)
    return int((count == 1).sum())


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_a_mesh_is_closed_and_sound(shape: Shape) -> None:
    mesh = build_mesh(shape, (1, 0))
    assert open_edges(mesh, 1e-4) == 0
    assert np.isfinite(mesh.positions).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(mesh.tangents, axis=1), 1.0, atol=1e-4)
    assert mesh.triangles.max() < len(mesh.positions)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_the_same_seed_gives_the_same_bytes(shape: Shape) -> None:
    first, again, other = (build_mesh(shape, (seed, 0)) for seed in (1, 1, 2))
    assert first.positions.tobytes() == again.positions.tobytes()
    if shape is not SHAFT:  # a tool has nothing random
        assert first.positions.tobytes() != other.positions.tobytes()


@pytest.mark.parametrize(("shape", "sign"), [(STOMACH, -1.0), (LIVER, 1.0)])
def test_normals_point_to_the_side_of_the_camera(shape: Blob, sign: float) -> None:
    mesh = build_mesh(shape, (1, 0))
    outward = mesh.positions - np.asarray(shape.centre, np.float32)
    assert (sign * np.einsum("ij,ij->i", outward, mesh.normals) > 0).mean() > 0.98


def test_texture_coordinates_of_a_tube_follow_arc_length() -> None:
    mesh = build_mesh(SMOOTH, (1, 0))
    corners, places = mesh.positions[mesh.triangles], mesh.uv[mesh.triangles]
    middle = np.abs(corners[..., 2].mean(1) - 50.0) < 30.0
    true = np.linalg.norm(corners[middle, 0] - corners[middle, 1], axis=1)
    seen = np.linalg.norm(places[middle, 0] - places[middle, 1], axis=1)
    assert np.median(np.abs(seen / true - 1.0)) < 0.02


def test_a_branch_opens_into_its_trunk() -> None:
    branch = Tube(((0, 0, 50), (20, 0, 55), (45, 0, 60)), 6.0, True, waves=0.0)
    shapes = [SMOOTH, branch]
    meshes = [build_mesh(shape, (k, 0)) for k, shape in enumerate(shapes)]
    trunk, twig = join_lumens(shapes, meshes)
    assert 0 < len(trunk.triangles) < len(meshes[0].triangles)
    centres = twig.positions[twig.triangles].mean(1)
    # Nothing of the branch is left inside the trunk, and its far end is whole.
    assert np.hypot(centres[:, 0], centres[:, 1])[centres[:, 0] < 9].min(initial=99.0) > 8.5
    assert centres[:, 0].max() > 44


def test_tiles_repeat_without_a_seam() -> None:
    tile = tile_noise(np.random.default_rng(1), (96, 128), 12.0)
    assert tile.mean() == pytest.approx(0.0, abs=0.02)
    assert tile.std() == pytest.approx(1.0, abs=0.05)
    for axis in (0, 1):
        steps = np.abs(np.diff(tile, axis=axis))
        seam = np.abs(np.take(tile, 0, axis) - np.take(tile, -1, axis))
        assert seam.mean() < 1.5 * steps.mean()


@pytest.mark.parametrize("wavelength", [8.0, 32.0])
def test_noise_has_the_wavelength_asked_for(wavelength: float) -> None:
    tile = tile_noise(np.random.default_rng(2), (512, 512), wavelength)
    power = np.abs(np.fft.rfft2(tile)) ** 2
    frequency = np.hypot(np.fft.fftfreq(512)[:, None], np.fft.rfftfreq(512)[None, :])
    typical = float((power * frequency).sum() / power.sum())
    assert 0.5 < typical * wavelength < 1.2


def test_octaves_add_finer_waves() -> None:
    rough, smooth = (fractal_tile(np.random.default_rng(3), (256, 256), 64.0, octaves) for octaves in (5, 1))
    assert np.abs(np.diff(rough)).mean() > 1.5 * np.abs(np.diff(smooth)).mean()


def test_space_noise_is_smooth_and_bounded() -> None:
    line = np.zeros((400, 3), np.float32)
    line[:, 0] = np.linspace(0, 40, 400)
    values = space_noise(np.random.default_rng(4), line, 10.0, 2, 0.5)
    assert np.abs(values).max() <= 1.0
    assert values.std() > 0.1
    assert np.abs(np.diff(values)).max() < 0.15
