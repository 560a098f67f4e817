"""Pictures of two cameras are matched by the numbers in their names; in one folder by the side as well."""

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
    left = files(tmp_path / "a", "L_10.png", "L_9.PNG", "notes.txt", "left.ppm", "._L_10.png")
    right = files(tmp_path / "b", "R_009.jpg", "R_010.jpg", "right.png", "R_11.json", "._right.png")
    found = [(one.name, other.name) for one, other in pair_pictures(left, right)]
    assert found == [("left.ppm", "right.png"), ("L_9.PNG", "R_009.jpg"), ("L_10.png", "R_010.jpg")]


def test_the_number_of_the_camera_does_not_count(tmp_path):
    left = files(tmp_path / "camA", "cam0_0000.png", "cam0_0010.png", "cam0_0002.png")
    right = files(tmp_path / "camB", "cam1_0000.png", "cam1_0010.png", "cam1_0002.png")
    found = [(one.name, other.name) for one, other in pair_pictures(left, right)]
    assert found == [(f"cam0_{number}.png", f"cam1_{number}.png") for number in ("0000", "0002", "0010")]


@pytest.mark.parametrize(
    ("left", "right"),
    [
        # The same names in both folders, whatever they are.
        (["a.png", "b.png"], ["a.jpg", "b.jpg"]),
        (["1.png", "2.png", "10.png"], ["1.png", "2.png", "10.png"]),
        (["seqA_0001.png", "seqB_0001.png"], ["seqA_0001.png", "seqB_0001.png"]),
        # One pair, which differs in the number of the camera.
        (["cam0_0007.png"], ["cam1_0007.png"]),
    ],
)
def test_names_that_leave_no_doubt_are_paired(tmp_path, left, right):
    found = [
        (one.name, other.name)
        for one, other in pair_pictures(files(tmp_path / "a", *left), files(tmp_path / "b", *right))
    ]
    assert found == list(zip(left, right, strict=True))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        # One picture on a side: which of its numbers is the camera's?
        (["1.png"], ["2.png"]),
        (["cam0_0007.png"], ["cam0_0008.png"]),
        (["cam0_0007.png"], ["cam1_0008.png"]),
        # A number that changes on one side counts on both.
        (["run1_1.png", "run1_2.png"], ["run1_1.png", "run2_1.png"]),
        # Names of another build: which of three numbers are which of two?
        (["cam0_1.png", "cam0_2.png"], ["cam1_take4_1.png", "cam1_take4_2.png"]),
        (["cam0_1.png", "cam0_2.png", "cover.png"], ["cam1_1.png", "cam1_2.png", "cover.png"]),
    ],
)
def test_what_a_number_counts_is_not_guessed(tmp_path, left, right):
    with pytest.raises(InvalidArgument, match=r"same numbers .* such as cam0_0007.png and cam1_0007.png; .* does not"):
        pair_pictures(files(tmp_path / "a", *left), files(tmp_path / "b", *right))


@pytest.mark.parametrize(
    "form",
    ["frame{}_{}.png", "{1}_{0}.png", "{1}{0}.jpg", "f7_dynamic_{1}_{0}.tif", "{0}-{1}.bmp"],
)
@pytest.mark.parametrize("sides", [("left", "right"), ("L", "R"), ("Left", "Right")])
def test_one_folder_may_hold_both_sides(tmp_path, form, sides):
    names = [(form.format(number, sides[0]), form.format(number, sides[1])) for number in (9, 10, 110)]
    folder = files(tmp_path / "a", "notes.txt", *(name for pair in names for name in pair))
    assert [(one.name, other.name) for one, other in pair_pictures(folder, folder)] == names


@pytest.mark.parametrize(
    ("names", "seen"),
    [
        (["1_left.png", "1_right.png", "1_mask.png"], "1_mask.png"),
        (["left_right_1.png", "right_right_1.png"], "left_right_1.png"),
        (["1_left.png", "1_L.png", "1_right.png"], "1_L.png and 1_left.png in .* alike"),
        (["a1_left.png", "b1_right.png"], r"a1_left.png, \S*b1_right.png without a partner"),
        (["1_left.png", "01_right.png"], "without a partner"),
        (["1_left.png"], "1_left.png without a partner"),
        (["calm_1.png", "calr_1.png"], "calm_1.png"),
    ],
)
def test_sides_are_not_guessed(tmp_path, names, seen):
    folder = files(tmp_path / "a", *names)
    with pytest.raises(InvalidArgument, match=rf"in one folder must have the side once .* got .*{seen}"):
        pair_pictures(folder, folder)


@pytest.mark.parametrize(
    ("left", "right", "rule"),
    [
        (["1.png", "2.png"], ["1.png"], r"pictures: must have the same numbers .* got \S+2.png without a partner \["),
        (["1.png"], [f"{number}.png" for number in range(1, 8)], r"2.png, \S+3.png, \S+4.png and 3 more"),
        (["1.png"], ["notes.txt"], "right: must hold pictures"),
        (["1.png", "1.jpg"], ["1.png"], "same numbers .* got 1.jpg and 1.png in .* which are alike"),
    ],
)
def test_pictures_without_a_partner_are_named(tmp_path, left, right, rule):
    with pytest.raises(InvalidArgument, match=rule):
        pair_pictures(files(tmp_path / "a", *left), files(tmp_path / "b", *right))


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidArgument, match="right: must be a folder"):
        pair_pictures(files(tmp_path / "a", "1.png"), tmp_path / "b")
