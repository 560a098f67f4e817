"""Painted tissue: the same for the same seed, coloured as drawn, with vessels that are darker than what they cross."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from endosdk.simulation.texture import paint_tissue
from endosdk.simulation.tissue import TISSUES, draw_tissue
from endosdk.simulation.vessels import draw_vessels


@pytest.mark.parametrize("kind", TISSUES)
def test_a_tissue_is_painted_near_its_colours(kind: str) -> None:
    tissue = replace(draw_tissue(np.random.default_rng(1), kind), stain=0.0)
    texture = paint_tissue(tissue, (1, 1), (60.0, 40.0), 192)
    assert texture.albedo.shape == (128, 192, 4)
    mean = (texture.albedo[..., :3].mean((0, 1)) / 255) ** 2
    bounds = np.array([(np.asarray(c) / 255) ** 2.2 for c in (tissue.base, tissue.second)])
    assert (mean > 0.4 * bounds.min(0)).all()
    assert (mean < 1.4 * bounds.max(0)).all()


def test_the_same_seed_paints_the_same_bytes() -> None:
    tissue = draw_tissue(np.random.default_rng(2), "serosa")
    first, again, other = (paint_tissue(tissue, (seed, 1), (50.0, 50.0), 128) for seed in (1, 1, 2))
    assert first.albedo.tobytes() == again.albedo.tobytes()
    assert first.detail.tobytes() == again.detail.tobytes()
    assert first.albedo.tobytes() != other.albedo.tobytes()


def test_detail_is_neutral_on_average() -> None:
    texture = paint_tissue(draw_tissue(np.random.default_rng(3), "colon"), (3, 1), (50.0, 50.0), 128)
    np.testing.assert_allclose(texture.detail.mean((0, 1)), 128, atol=6)


def test_bubbles_are_painted_here_and_there_and_wet() -> None:
    tissue = draw_tissue(np.random.default_rng(6), "gastric")
    plain, foamy = (paint_tissue(replace(tissue, bubbles=b), (6, 1), (60.0, 60.0), 512) for b in (0.0, 1.0))
    changed = (plain.albedo[..., :3] != foamy.albedo[..., :3]).any(-1)
    assert 0.002 < changed.mean() < 0.3
    assert (foamy.albedo[..., 3] >= plain.albedo[..., 3]).all()
    assert foamy.albedo[changed][:, 3].mean() > plain.albedo[changed][:, 3].mean() + 50
    assert foamy.detail.tobytes() == plain.detail.tobytes()


def test_more_vessels_cover_more() -> None:
    tissue = replace(draw_tissue(np.random.default_rng(4), "serosa"), vessel_mm=0.8, deep=0.5)
    covered = []
    for density in (0.2, 2.0):
        deep, surface = draw_vessels(np.random.default_rng(5), replace(tissue, vessel_density=density), (256, 256), 4.0)
        assert deep.shape == surface.shape == (256, 256)
        assert deep.max() <= 1.0
        assert surface.max() > 0.3
        covered.append(float((surface > 0.2).mean()))
    assert covered[1] > 2 * covered[0] > 0
