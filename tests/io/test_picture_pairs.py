"""Pictures of two cameras are matched by the numbers in their names."""

from __future__ import annotations

from pathlib import Path

import pytest

from endosdk.errors import InvalidArgument
from endosdk.io.picture_pairs import pair_pictures


def files(folder: Path, *names: str) -> Path:
    folder.mkdir()
    for name in names:
        (folder / name).touch()
    return folder


def test_numbers_match_and_order_the_pictures(tmp_path):
    left = files(tmp_path / "a", "L_10.png", "L_9.PNG", "notes.txt", "left.bmp")
    right = files(tmp_path / "b", "R_009.jpg", "R_010.jpg", "right.png", "R_11.json")
    found = [(one.name, other.name) for one, other in pair_pictures(left, right)]
    assert found == [("left.bmp", "right.png"), ("L_9.PNG", "R_009.jpg"), ("L_10.png", "R_010.jpg")]


@pytest.mark.parametrize(
    ("left", "right", "rule"),
    [
        (["1.png", "2.png"], ["1.png"], r"pictures: must have the same numbers .* got \S+2.png \["),
        (["1.png"], [f"{number}.png" for number in range(1, 8)], r"2.png, \S+3.png, \S+4.png and 3 more"),
        (["1.png"], ["notes.txt"], "right: must hold pictures"),
        (["1.png", "1.jpg"], ["1.png"], "left: must hold pictures whose names differ in their numbers"),
    ],
)
def test_pictures_without_a_partner_are_named(tmp_path, left, right, rule):
    with pytest.raises(InvalidArgument, match=rule):
        pair_pictures(files(tmp_path / "a", *left), files(tmp_path / "b", *right))


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidArgument, match="right: must be a folder"):
        pair_pictures(files(tmp_path / "a", "1.png"), tmp_path / "b")
