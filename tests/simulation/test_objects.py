"""Scenes without anatomy: exact truth for both views, the whole range, and the same bits for the same seed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.simulation import surfaces
from endosdk.simulation.objects.arrangement import OBJECTS
from endosdk.simulation.objects.pair import render_objects
from endosdk.simulation.patterns import PATTERNS, draw_pattern
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.rigs import OBJECT_SPANS, SceneRig, draw_camera, draw_range
from endosdk.simulation.surfaces import mesh_of
from tests.simulation.matched_views import at_match, check_views_match_best_at_the_truth, seen_by_both

SEEDS = range(5, 13)


def rig_of(seed: int, width: int = 320) -> SceneRig:
    rng = np.random.default_rng((seed, 19))
    return draw_range(rng, *draw_camera(rng, width, None), 0.25 * width, OBJECT_SPANS)


@pytest.fixture(scope="module")
def samples(renderer: Rasteriser) -> list[Sample]:
    return [render_objects(renderer, seed, rig_of(seed)) for seed in SEEDS]


def test_truth_is_everywhere_and_never_nearer_than_the_rig_may_see(samples: list[Sample]) -> None:
    for seed, sample in zip(SEEDS, samples, strict=True):
        assert sample.disparity_right is not None
        for disparity in (sample.disparity, sample.disparity_right):
            assert np.isfinite(disparity).mean() > 0.999
            assert 0 < np.nanmin(disparity) < np.nanmax(disparity) <= rig_of(seed).nearest


def test_the_right_view_moved_by_the_truth_is_the_left_view(samples: list[Sample]) -> None:
    """Half a pixel more or less is worse in every scene: no bias, and no edge on the wrong side."""
    for sample in samples:
        check_views_match_best_at_the_truth(sample, gain=0.9)


def test_left_and_right_truth_agree_where_both_see(samples: list[Sample]) -> None:
    for sample in samples:
        assert sample.disparity_right is not None
        gap = np.abs(at_match(sample.disparity_right, sample.disparity) - sample.disparity)[seen_by_both(sample)]
        assert np.quantile(gap, 0.9) < 0.02


def test_the_same_seed_gives_the_same_bits(renderer: Rasteriser, samples: list[Sample]) -> None:
    again = render_objects(renderer, SEEDS[2], rig_of(SEEDS[2]))
    for name in ("left", "right", "disparity", "disparity_right"):
        assert getattr(again, name).tobytes() == getattr(samples[2], name).tobytes()
    assert again.info == samples[2].info
    assert samples[1].left.tobytes() != samples[2].left.tobytes()


@pytest.mark.parametrize("name", PATTERNS)
def test_every_pattern_repeats_without_a_seam(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("endosdk.simulation.patterns.PATTERNS", {name: 1.0})
    found, picture = draw_pattern(np.random.default_rng(4))
    assert found == name
    assert picture.shape == (256, 256, 3)
    assert (picture.std() < 60) if name == "plain" else (picture.reshape(-1, 3).std(0).max() > 2)
    if name == "letters":  # single letters may be cut
        return
    steps = np.abs(np.diff(picture.astype(float), axis=1)).mean((0, 2))
    seam = np.abs(picture[:, 0].astype(float) - picture[:, -1]).mean()
    assert seam <= steps.max() + 1


@pytest.mark.parametrize("name", [*OBJECTS, "wires"])
def test_every_object_is_a_sound_mesh(name: str) -> None:
    rng = np.random.default_rng(8)
    patches = surfaces.wires(rng, 0.02) if name == "wires" else OBJECTS[name][1](rng)
    mesh = mesh_of(patches, 1.0, np.array([0.0, 0.0, -9.0]))
    assert np.isfinite(mesh.positions).all()
    assert np.abs(mesh.positions).max() < 3
    assert mesh.triangles.max() == len(mesh.positions) - 1
    corners = mesh.positions[mesh.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (area > 1e-9).mean() > 0.8  # the ends of rods and the poles of bodies are points
    length = np.linalg.norm(mesh.normals, axis=1)
    assert (np.abs(length - 1) < 1e-3).mean() > 0.8


def test_a_set_of_shapes_is_made_by_the_command(renderer: Rasteriser, tmp_path: Path) -> None:
    words = ["--organ", "shapes", "--rig", "drawn", "--aspect", "drawn", "--faults", "--width", "160", "--pairs", "6"]
    assert main(["simulate", "--out", str(tmp_path / "set"), *words]) == 0
    record = json.loads((tmp_path / "set" / "dataset.json").read_text())
    assert record["camera"] == {"width": 160}
    assert record["disparity_limits_px"]["largest"] == 40.0
    reader = open_dataset(tmp_path / "set", "train")
    assert len({sample.focal_px for sample in reader}) == 6
    assert all(sample.left.shape[1] == 160 for sample in reader)
    assert any("faults" in sample.info for sample in reader)
