"""Vertical disparity measured on pairs made for it and on real endoscope frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from endosdk.errors import InvalidArgument
from endosdk.evaluation.vertical_disparity import MIN_MATCHES, vertical_disparity
from endosdk.io.pictures import read_frame
from tests.conftest import textured_picture


def pair_with_rows_off_by(rows: int, disparity: int = 30) -> tuple[np.ndarray, np.ndarray]:
    picture = textured_picture(260, 330, seed=3)
    return picture[20:220, :280], picture[20 + rows : 220 + rows, disparity : 280 + disparity]


@pytest.mark.parametrize("rows", [0, 1, 7, 20])
def test_known_shift_is_measured(rows: int) -> None:
    offset = vertical_disparity(*pair_with_rows_off_by(rows))
    assert offset.matches >= MIN_MATCHES
    assert offset.median_px == pytest.approx(rows, abs=0.1)
    assert offset.p95_px == pytest.approx(rows, abs=0.5)


def test_gray_and_colour_give_an_answer() -> None:
    left, right = pair_with_rows_off_by(5)
    green = vertical_disparity(left[..., 1], right[..., 1])
    assert green == vertical_disparity(left[..., 1:2], right[..., 1:2]) == vertical_disparity(left, right)
    assert green.median_px == pytest.approx(5, abs=0.1)


@pytest.mark.parametrize(
    "pair",
    [
        (np.full((200, 300, 3), 90, np.uint8), np.full((200, 300, 3), 90, np.uint8)),
        (textured_picture(300, 400, seed=1), textured_picture(300, 400, seed=2)),
        (textured_picture(300, 400, seed=1), np.zeros((300, 400, 3), np.uint8)),
        (np.zeros((1, 1), np.uint8), np.zeros((1, 1), np.uint8)),
    ],
    ids=["flat", "unrelated", "one dark", "one pixel"],
)
def test_no_number_is_guessed_from_too_few_matches(pair: tuple[np.ndarray, np.ndarray]) -> None:
    offset = vertical_disparity(*pair)
    assert offset.median_px is None and offset.p95_px is None and offset.matches < MIN_MATCHES


@pytest.mark.parametrize(
    "bad", [np.zeros((4, 4)), np.zeros((4, 4, 4), np.uint8), np.zeros(4, np.uint8), np.zeros((0, 4), np.uint8), None]
)
def test_what_is_no_picture_is_refused(bad: object) -> None:
    good = np.zeros((4, 4), np.uint8)
    with pytest.raises(InvalidArgument, match="left"):
        vertical_disparity(bad, good)  # type: ignore[arg-type]
    with pytest.raises(InvalidArgument, match="right"):
        vertical_disparity(good, bad)  # type: ignore[arg-type]


def test_raw_endoscope_pair_is_clearly_off(shared_data: Path) -> None:
    folder = shared_data / "scared_raw"
    offset = vertical_disparity(read_frame(folder / "left_51.png"), read_frame(folder / "right_51.png"))
    assert offset.median_px is not None and 9 < offset.median_px < 22 and offset.matches > 300


def test_rectified_endoscope_pair_agrees(shared_data: Path) -> None:
    folder = shared_data / "scared_rectified"
    offset = vertical_disparity(read_frame(folder / "left.png"), read_frame(folder / "right.png"))
    assert offset.median_px is not None and offset.p95_px is not None
    assert 0.2 < offset.median_px < 0.5 and offset.p95_px < 1.5 and offset.matches > 500
