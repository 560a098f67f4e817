"""Boards rendered by a rig with known numbers: both kinds give the rig back, and the collector says what to do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.calibration.board import BoardCalibration, calibrate_views
from endosdk.calibration.board_page import LeftOut, board_page, parameter_values
from endosdk.calibration.boards import Board, BoardView, find_view
from endosdk.calibration.rig import StereoCalibration
from endosdk.calibration.view_collector import ViewCollector, coverage, edge_width
from endosdk.commands.cli import main
from tests.live.videos import write
from tests.rendered_boards import POSES, shown
from tests.rigs import raw_rig

COEFFICIENTS = np.array([-0.2, 0.1, 0.001, -0.0007])
CHESSBOARD = Board((9, 6), 3.0)
CHARUCO = Board((9, 6), 3.0, 2.2)


@pytest.fixture(scope="module")
def rig() -> StereoCalibration:
    return raw_rig(left_distortion=COEFFICIENTS, right_distortion=0.8 * COEFFICIENTS)


@pytest.fixture(scope="module")
def pictures(rig: StereoCalibration) -> list[list[np.ndarray]]:
    return [shown(CHESSBOARD, rig, pose, seed=i) for i, pose in enumerate(POSES)]


def found_views(board: Board, pictures: list[list[np.ndarray]]) -> list[BoardView]:
    views = [find_view(board, f"view {i}", *pair) for i, pair in enumerate(pictures)]
    return [view for view in views if isinstance(view, BoardView)]


@pytest.fixture(scope="module")
def views(pictures: list[list[np.ndarray]]) -> list[BoardView]:
    return found_views(CHESSBOARD, pictures)


@pytest.fixture(scope="module")
def calibrated(rig: StereoCalibration, views: list[BoardView]) -> BoardCalibration:
    return calibrate_views(views, (rig.width, rig.height))


def assert_same_rig(found: StereoCalibration, rig: StereoCalibration) -> None:
    assert found.left_matrix[0, 0] == pytest.approx(rig.left_matrix[0, 0], rel=0.003)
    assert found.right_matrix[1, 2] == pytest.approx(rig.right_matrix[1, 2], abs=2.0)
    np.testing.assert_allclose(found.rotation, rig.rotation, atol=1e-3)
    assert found.translation == pytest.approx(rig.translation, abs=0.05)


def scores(result: BoardCalibration, rig: StereoCalibration) -> list[float]:
    """How many standard errors each number of a calibration is from the rig's."""
    assert result.errors is not None
    true = parameter_values(replace(result, calibration=rig))
    found, errors = parameter_values(result), result.errors.standard_errors
    return [(found[name][0] - true[name][0]) / error for name, error in errors.items()]


def test_a_rendered_chessboard_gives_the_rig_back(
    rig: StereoCalibration, views: list[BoardView], calibrated: BoardCalibration
) -> None:
    assert len(views) >= 8
    assert calibrated.reprojection_px < 0.05
    assert calibrated.errors is not None
    assert calibrated.errors.standard_errors["translation x"] < 0.005
    # The detector alone makes the focal length 10 standard errors too long.
    assert np.max(np.abs(scores(calibrated, rig))) < 4
    assert_same_rig(calibrated.calibration, rig)


@pytest.mark.slow
@pytest.mark.parametrize(("board", "wide"), [(CHESSBOARD, 1.0), (CHARUCO, 1.4)], ids=["chessboard", "charuco"])
def test_stated_errors_hold_the_truth_of_rendered_boards(rig: StereoCalibration, board: Board, wide: float) -> None:
    """Boards in other places each time: 95 % intervals hold about 95 % of the rig's numbers."""
    rng = np.random.default_rng(4)
    found = []
    for number in range(3):
        poses = [
            (
                np.array(turn) + rng.normal(0, 0.08, 3),
                np.array(place) * (wide, wide, wide**-0.7) + rng.normal(0, 1.5, 3),
            )
            for turn, place in POSES
        ]
        shots = [shown(board, rig, pose, noise=1.5, seed=100 * number + i) for i, pose in enumerate(poses)]
        found += scores(calibrate_views(found_views(board, shots), (rig.width, rig.height)), rig)
    within, spread = float((np.abs(found) < 1.96).mean()), float(np.sqrt(np.mean(np.square(found))))
    print(f"{100 * within:.1f} % of {len(found)} numbers lie within, root mean square {spread:.2f}")
    assert 0.9 < within < 0.995
    assert 0.7 < spread < 1.25


def test_a_rendered_charuco_board_gives_the_rig_back_from_parts(rig: StereoCalibration) -> None:
    near = [(turn, (1.7 * place[0], 1.7 * place[1], 0.72 * place[2])) for turn, place in POSES]
    views = found_views(CHARUCO, [shown(CHARUCO, rig, pose, seed=i) for i, pose in enumerate(near)])
    assert len(views) >= 8
    assert min(view.count for view in views) < 54  # some are seen in part
    result = calibrate_views(views, (rig.width, rig.height))
    assert result.reprojection_px < 0.35
    assert result.errors is not None
    assert result.errors.standard_errors["translation x"] < 0.02
    assert_same_rig(result.calibration, rig)


def test_the_collector_takes_what_is_new_and_says_what_is_missing(
    rig: StereoCalibration, pictures: list[list[np.ndarray]]
) -> None:
    collector = ViewCollector(CHESSBOARD, (rig.width, rig.height), wanted=6)
    assert collector.offer("1", *pictures[0]).taken
    assert "like a view before: tilt it more" in collector.offer("2", *pictures[0]).reason
    assert "moving" in collector.offer("3", *pictures[3]).reason  # elsewhere in the very next frame
    assert collector.offer("4", *pictures[3]).taken
    blurred = [cv2.GaussianBlur(view, (0, 0), 3.0) for view in pictures[3]]
    assert "blurred" in collector.offer("5", *blurred).reason
    nothing = np.full_like(pictures[0][0], 128)
    assert "no whole board in the right view" in collector.offer("6", pictures[1][0], nothing).reason
    for i in (1, 2, 4, 5, 6, 7, 8, 9):
        collector.offer(f"{i} first", *pictures[i])
        collector.offer(f"{i} again", *pictures[i])
    assert len(collector.views) >= 6
    assert collector.advice() in ("", "show it from nearer and from farther away") or "show it at the" in (
        collector.advice()
    )
    assert coverage(collector.views, (rig.width, rig.height)).sum() == 54 * len(collector.views)


def test_edges_are_as_wide_as_they_are_blurred(pictures: list[list[np.ndarray]]) -> None:
    view = find_view(CHESSBOARD, "a", *pictures[0])
    assert isinstance(view, BoardView)
    widths = [edge_width(cv2.GaussianBlur(pictures[0][0], (0, 0), s), view.left) for s in (0.1, 1.5, 3.0)]
    assert widths[0] < 4 < widths[2]
    assert widths == sorted(widths)


def test_every_cause_of_frames_left_out_is_told_and_counted(
    pictures: list[list[np.ndarray]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As many frames without a board as frames that show nothing new."""
    frames = [np.hstack(pair) for pair in pictures[:4]]
    video = write(tmp_path / "v.mkv", [one for shot in frames for one in (np.zeros_like(shot), shot, shot)])
    words = ["calibrate", "board", str(video), "--pattern", "9x6", "--square-mm", "3", "--json"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    count = len(frames)
    assert record["pairs_used"] == count
    assert record["skipped"] == [
        {"name": f"{count} frames", "reason": reason, "views": count}
        for reason in ("no whole board in either view", "like a view before")
    ]
    for reason in ("no whole board in either view", "like a view before"):
        assert f"left out    {count} frames: {reason}" in said.err
    assert main([*words[:-1], "--out", str(tmp_path / "again.json")]) == 0
    assert f"pairs       {count} used, {2 * count} left out" in capsys.readouterr().out


@pytest.mark.parametrize("both_ways", [False, True])
def test_folders_of_a_board_that_is_tilted_one_way_only_get_advice(
    rig: StereoCalibration, tmp_path: Path, capsys: pytest.CaptureFixture[str], both_ways: bool
) -> None:
    for i, (across, down) in enumerate([(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)]):
        turn = (0.4 * across if both_ways else 0.0, 0.4 * down, 0.0)
        for side, view in zip(
            ("left", "right"), shown(CHESSBOARD, rig, (turn, (2 * i - 4, 3 - i, 58 + 2 * i))), strict=True
        ):
            (tmp_path / side).mkdir(exist_ok=True)
            cv2.imwrite(str(tmp_path / side / f"{i}.png"), view)
    words = ["calibrate", "board", str(tmp_path), "--pattern", "9x6", "--square-mm", "3"]
    assert main([*words, "--out", str(tmp_path / "rig.json")]) == 0
    assert ("advice      tilt the board more, both ways" in capsys.readouterr().err) is not both_ways


def test_the_page_says_all_and_asks_nothing_of_others(calibrated: BoardCalibration) -> None:
    left_out = [LeftOut("<b>07</b>", "no whole board"), LeftOut("8 frames", "moving", 8)]
    page = board_page(calibrated, left_out, {"fast": 16.2, "other": None})
    for part in ("Coverage", "translation x", "30 mm", "100 mm", "standard error", "17 mm", "not stated", "view 3"):
        assert part in page
    assert "9 left out" in page
    assert "<b>07" not in page  # names are text
    assert "http" not in page and "<script" not in page
