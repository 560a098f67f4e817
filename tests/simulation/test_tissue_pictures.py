"""A user's own pictures as the colours of tissue: found, mirrored without a seam, evenly lit, named without a place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.errors import InvalidArgument
from endosdk.io.pictures import write_picture
from endosdk.simulation.camera import Pose
from endosdk.simulation.effects import Effects, affected
from endosdk.simulation.sample import Placed, describe
from endosdk.simulation.scene import draw_scene
from endosdk.simulation.texture import paint_tissue
from endosdk.simulation.tissue import TISSUES, draw_tissue
from endosdk.simulation.tissue_pictures import PICTURE_MM, find_pictures, tissue_tile


def tissue(seed: int = 0, height: int = 96, width: int = 128) -> np.ndarray:
    coarse = np.random.default_rng(seed).integers(60, 200, (height // 8, width // 8, 3))
    return np.kron(coarse, np.ones((8, 8, 1))).astype(np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine").mkdir()
    for seed in range(2):
        write_picture(tmp_path / "mine" / f"{seed}.png", tissue(seed))
    (tmp_path / "mine" / "notes.txt").write_text("no picture")
    return tmp_path / "mine"


def test_tiles_have_the_colours_of_the_picture_and_no_seam(folder: Path) -> None:
    picture = find_pictures(folder)[0]
    scale = 128 / PICTURE_MM  # the picture at its own size
    tile = tissue_tile(picture, np.random.default_rng(1), (400, 600), scale)
    assert tile.shape == (400, 600, 3) and 0 <= tile.min() and tile.max() <= 1
    linear = (tissue(0) / 255.0) ** 2.2
    assert np.allclose(tile.mean((0, 1)), linear.mean((0, 1)), rtol=0.1)
    # Steps from pixel to pixel are those within the picture: mirrored copies meet without one of their own.
    steps = np.abs(np.diff(tile, axis=1)).max(axis=(0, 2))
    assert np.array_equal(tile[:, :256], tile[:, 256:512])  # there and back again
    assert (steps == 0).sum() >= 600 // 128  # where a copy ends the next begins with the same column


def test_the_lamp_of_the_picture_is_divided_out(folder: Path) -> None:
    lamp = np.linspace(0.4, 1.0, 128)[:, None]
    write_picture(folder / "0.png", (tissue() * lamp).astype(np.uint8))
    tile = tissue_tile(find_pictures(folder)[0], np.random.default_rng(1), (96, 256), 128 / PICTURE_MM)
    columns, lit = tile.mean((0, 2)), ((tissue() * lamp / 255.0) ** 2.2).mean((0, 2))
    assert columns.max() / columns.min() < 3.0 < 7.0 < lit.max() / lit.min()


def test_a_surface_takes_its_colours_from_the_picture_and_keeps_its_relief(folder: Path) -> None:
    drawn = draw_tissue(np.random.default_rng(3), "colon")
    plain, pictured = (
        paint_tissue(replace(drawn, picture=picture), (3, 1), (50.0, 40.0), 128)
        for picture in (None, find_pictures(folder)[0])
    )
    assert plain.albedo.shape == pictured.albedo.shape
    assert not np.array_equal(plain.albedo[..., :3], pictured.albedo[..., :3])
    assert plain.detail.shape == pictured.detail.shape and pictured.detail[..., 1:3].std() > 0


def test_every_tissue_of_a_scene_has_a_picture_and_its_record_names_it_without_its_place(folder: Path) -> None:
    pictures = find_pictures(folder)
    effects = Effects(textures=pictures)
    scene = affected(draw_scene(5, "abdomen"), effects)
    assert all(part.tissue.picture in pictures for part in scene.parts if part.tissue.kind in TISSUES)
    assert scene == affected(draw_scene(5, "abdomen"), effects)
    record = describe(Placed(scene, Pose(np.zeros(3), np.eye(3)), 1.0, 50.0))
    assert record["parts"][0]["tissue"]["picture"] in [picture.described for picture in pictures]
    assert str(folder) not in str(record) and str(folder) not in str(effects.described())
    assert effects.described()["textures"][0] == {"name": "0.png", "sha256": pictures[0].sha256}
    bare = describe(Placed(draw_scene(5, "abdomen"), Pose(np.zeros(3), np.eye(3)), 1.0, 50.0))
    assert "picture" not in str(bare) and "textures" not in Effects().described()


def test_folders_that_cannot_be_used_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InvalidArgument, match=r"textures: must be a folder"):
        find_pictures(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidArgument, match=r"textures: must hold pictures"):
        find_pictures(tmp_path / "empty")
    picture = find_pictures(folder)[1]
    write_picture(folder / "1.png", tissue(7))
    with pytest.raises(InvalidArgument, match=r"textures: must stay as they are"):
        tissue_tile(picture, np.random.default_rng(1), (96, 128), 3.0)
    (folder / "2.png").write_bytes((folder / "1.png").read_bytes()[:-20])
    with pytest.raises(InvalidArgument, match=r"textures: 2\.png "):
        find_pictures(folder)
    write_picture(folder / "2.png", tissue(7, 32, 64))
    with pytest.raises(InvalidArgument, match=r"textures: 2\.png must have at least 64 px a side; got 64x32"):
        find_pictures(folder)
    given = ["simulate", "--textures", str(folder), "--recipe", "endosim-gi", "--out", str(tmp_path / "out")]
    assert main(given) == 2
    assert "recipe: settles what describes a set, so leave out the rest; got --textures" in capsys.readouterr().err
