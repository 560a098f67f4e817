"""Scenes of surgery: instruments in front of the tissue, up to a quarter of the width, with exact truth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.simulation.camera import Pose, StereoCamera, look
from endosdk.simulation.effects import Effects
from endosdk.simulation.organ import SHARED_BY, render_organ
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.surfaces import mesh_of
from endosdk.simulation.tools import pieces
from endosdk.simulation.tools.materials import TONES, draw_material
from endosdk.simulation.tools.place import BareView, draw_tools, into_organ
from tests.simulation.matched_views import check_views_match_best_at_the_truth

CAMERA = StereoCamera(320, 240, 300.0, 4.2)
RIG = SceneRig(CAMERA, (150.0, 126.0), "middle", farthest=5.0, nearest=24.0, limit=80.0)
SEEDS = (9, 10, 12)  # the first two look at one organ


@pytest.fixture(scope="module")
def samples(renderer: Rasteriser) -> list[Sample]:
    return [render_organ(renderer, seed, "lap", RIG, Effects(), clean=True) for seed in SEEDS]


@pytest.mark.parametrize("name", pieces.ENDS)
def test_every_instrument_is_made_of_sound_meshes(name: str) -> None:
    for part in pieces.ENDS[name][1](np.random.default_rng(3)) + pieces.shaft(np.random.default_rng(4)):
        assert part.material in TONES
        mesh = mesh_of(part.patches, 1.0, np.zeros(3))
        assert np.isfinite(mesh.positions).all()
        corners = mesh.positions[mesh.triangles]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert (area > 1e-9).mean() > 0.8
        outwards = mesh.positions - mesh.positions.mean(0)
        if name != "fenestrated":  # a loop has an inside
            assert np.mean((outwards * mesh.normals).sum(1) > 0) > 0.6


def test_what_lies_about_is_of_its_size() -> None:
    rng = np.random.default_rng(6)
    for parts in (pieces.needle(rng), pieces.clips(rng), pieces.trocar(rng)):
        points = np.concatenate([part.patches.points.reshape(-1, 3) for part in parts[:1]])
        assert 0.5 < np.abs(points).max() < 4


@pytest.mark.parametrize("name", TONES)
def test_a_material_has_its_tone(name: str) -> None:
    look, texture = draw_material(np.random.default_rng(2), name, (1.0, 1.0), 1.0)
    assert look.kind == name
    assert look.metallic == (name in ("steel", "gold"))
    low, high = (np.mean(bound) for bound in TONES[name])
    assert 0.5 * low < np.median(texture.albedo[..., :3]) < 1.3 * high


def test_tools_stand_between_the_tissue_and_the_nearest_that_the_rig_may_show() -> None:
    view = BareView(RIG, np.full((240, 320), 60.0, np.float32), 60.0)
    sizes = []
    for seed in range(40):
        found, described = draw_tools(np.random.default_rng(seed), view)
        assert bool(found) == bool(described["tools"])
        for mesh, _, _ in found:
            z = mesh.positions[:, 2]
            shown = (z > 0) & (np.abs(mesh.positions[:, 0]) < 0.4 * z) & (np.abs(mesh.positions[:, 1]) < 0.3 * z)
            if shown.any():
                sizes.append(float(z[shown].min()) / view.nearest)
    assert min(sizes) > 0.99
    assert np.quantile(sizes, 0.1) < 1.5  # many are near


def test_a_surface_comes_back_from_the_organ_where_it_was() -> None:
    view = BareView(RIG, np.full((240, 320), 60.0, np.float32), 60.0)
    surface = draw_tools(np.random.default_rng(1), view)[0][0]
    pose, scale = look(np.array([3.0, -4.0, 5.0]), np.array([10.0, 2.0, 50.0]), 0.7), 2.5
    moved = into_organ(surface, pose, scale)[0]
    back = scale * (moved.positions - pose.position) @ pose.axes.T
    np.testing.assert_allclose(back, surface[0].positions, atol=2e-3)
    np.testing.assert_allclose(moved.normals @ pose.axes.T, surface[0].normals, atol=1e-5)


def test_the_picture_reaches_nearer_than_the_tissue_and_never_too_near(samples: list[Sample]) -> None:
    for sample in samples:
        assert sample.disparity_right is not None
        for disparity in (sample.disparity, sample.disparity_right):
            assert np.nanmax(disparity) <= RIG.limit
            assert np.isfinite(disparity).mean() > 0.99
        assert sample.info["tools"]
    assert max(float(np.nanmax(sample.disparity)) for sample in samples) > 1.5 * RIG.nearest


def test_the_right_view_moved_by_the_truth_is_the_left_view(samples: list[Sample]) -> None:
    for sample in samples:
        check_views_match_best_at_the_truth(sample)


def test_neighbouring_seeds_share_an_organ_and_nothing_else(samples: list[Sample]) -> None:
    scenes = [sample.info["scene"] for sample in samples]
    assert SEEDS[0] // SHARED_BY == SEEDS[1] // SHARED_BY != SEEDS[2] // SHARED_BY
    assert scenes[0]["parts"] == scenes[1]["parts"] != scenes[2]["parts"]
    for name in ("pose", "lamp", "sensor"):
        assert scenes[0][name] != scenes[1][name]
    assert isinstance(Pose(**{k: np.array(v) for k, v in scenes[0]["pose"].items()}), Pose)


def test_the_same_seed_gives_the_same_bits_whatever_was_drawn_before(
    renderer: Rasteriser, samples: list[Sample]
) -> None:
    again = render_organ(renderer, SEEDS[1], "lap", RIG, Effects(), clean=True)
    for name in ("left", "right", "disparity", "disparity_right"):
        assert getattr(again, name).tobytes() == getattr(samples[1], name).tobytes()
    assert again.info == samples[1].info


def test_a_set_of_surgery_is_made_by_the_command(renderer: Rasteriser, tmp_path: Path) -> None:
    out = tmp_path / "set"
    words = ["--organ", "lap", "--rig", "drawn", "--faults", "--width", "160", "--pairs", "3", "--seed", "6"]
    assert main(["simulate", "--out", str(out), *words]) == 0
    record = json.loads((out / "dataset.json").read_text())
    assert record["camera"] == {"width": 160, "height": 120}
    assert record["organ_shares"]["abdomen"] == 0.7
    reader = open_dataset(out, "train")
    assert len({sample.focal_px for sample in reader}) == 3
    for sample in reader:
        assert np.nanmax(sample.disparity) <= 40
        assert {"rig", "tools"} <= set(sample.info)
