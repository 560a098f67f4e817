"""A video: frames with truth of their own along one smooth way, at one scale, continued frame by frame."""

from __future__ import annotations

import resource
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.verifier import verify_dataset
from endosdk.simulation.scene import draw_scene
from endosdk.simulation.stereo_video import draw_flight

WORDS = (
    *("--organ", "stomach", "--seed", "3", "--width", "64", "--height", "48", "--focal", "27"),
    *("--max-disparity", "6", "--min-disparity", "0.2", "--video", "--frames", "3", "--pairs", "1"),
)


def film(out: Path, *more: str) -> list[Sample]:
    assert main(["simulate", "--out", str(out), *WORDS, *more]) == 0
    return list(open_dataset(out, "train"))


@pytest.fixture(scope="module")
def out(renderer: object, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film") / "set"
    film(folder)
    return folder


def test_every_frame_is_a_sample_of_one_scene(out: Path) -> None:
    frames = list(open_dataset(out, "train"))
    assert [frame.id for frame in frames] == [f"003000000-{k:04d}" for k in range(3)]
    assert len({frame.info["scene"]["scale"] for frame in frames}) == 1
    positions = np.array([frame.info["scene"]["pose"]["position"] for frame in frames])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert (steps > 0).all()
    assert steps.max() < 10
    for frame in frames:
        assert np.nanmax(frame.disparity) <= 6
    assert frames[0].left.tobytes() != frames[1].left.tobytes()


def test_poses_lead_from_one_frame_to_another(out: Path) -> None:
    frames = list(open_dataset(out, "train"))
    height, width = frames[0].disparity.shape
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    rows, columns = np.indices((height, width))

    def depth_of(frame: Sample) -> np.ndarray:
        return frame.focal_px * frame.baseline_mm / frame.disparity.astype(np.float64)

    def pose_of(frame: Sample) -> tuple[np.ndarray, np.ndarray]:
        scene = frame.info["scene"]
        return np.array(scene["pose"]["axes"]), scene["scale"] * np.array(scene["pose"]["position"])

    first, last = frames[0], frames[-1]
    depth = depth_of(first)
    points = np.stack(
        [(columns - centre[0]) / first.focal_px, (rows - centre[1]) / first.focal_px, np.ones_like(depth)], axis=-1
    )
    (axes, position), (other_axes, other_position) = pose_of(first), pose_of(last)
    seen = ((points * depth[..., None]) @ axes + position - other_position) @ other_axes.T
    at = np.rint(seen[..., :2] / seen[..., 2:] * last.focal_px + centre).astype(int)
    inside = (seen[..., 2] > 0) & (at >= 0).all(-1) & (at < (width, height)).all(-1)
    found = depth_of(last)[at[inside][:, 1], at[inside][:, 0]]
    error = np.abs(seen[inside][:, 2] / found - 1)
    unmoved = np.abs(depth[inside] / found - 1)
    assert inside.mean() > 0.5
    assert np.nanmedian(error) < 0.01 < np.nanmedian(unmoved)


def test_the_film_shows_both_views_side_by_side(out: Path) -> None:
    film_file = cv2.VideoCapture(str(out / "videos" / "train-003000000.mp4"))
    frames = []
    while (read := film_file.read())[0]:
        frames.append(read[1])
    assert [frame.shape for frame in frames] == [(48, 128, 3)] * 3
    left = open_dataset(out, "train")[0].left[..., ::-1]
    assert np.abs(frames[0][:, :64].astype(float) - left).mean() < 15


def test_an_interrupted_video_goes_on_to_the_same_frames(out: Path, tmp_path: Path) -> None:
    again = tmp_path / "set"
    shutil.copytree(out, again)
    (again / "dataset.json").unlink()
    shutil.rmtree(again / "train" / "003000000-0001")
    shutil.rmtree(again / "videos")
    kept = (again / "train" / "003000000-0000").stat().st_mtime_ns
    film(again)
    assert (again / "train" / "003000000-0000").stat().st_mtime_ns == kept
    assert open_dataset(again, "train").sha256 == open_dataset(out, "train").sha256
    assert all(fault is None for _, fault in verify_dataset(again))
    assert (again / "videos" / "train-003000000.mp4").exists()


def test_an_open_shutter_blurs_and_leaves_the_truth(out: Path, tmp_path: Path) -> None:
    blurred = film(tmp_path / "set", "--shutter", "1.0")
    for frame, sharp in zip(blurred, open_dataset(out, "train"), strict=True):
        np.testing.assert_array_equal(frame.disparity, sharp.disparity)
        assert frame.left.tobytes() != sharp.left.tobytes()


def test_a_flight_is_smooth() -> None:
    flight = draw_flight(draw_scene(4, "intestine"), 50, 0)
    assert (
        flight.pose(7).position.tobytes() == draw_flight(draw_scene(4, "intestine"), 50, 0).pose(7).position.tobytes()
    )
    axes = np.stack([flight.pose(frame).axes for frame in range(50)])
    turns = np.degrees(np.arccos(np.clip((np.einsum("nij,nij->n", axes[1:], axes[:-1]) - 1) / 2, -1, 1)))
    assert turns.max() < 3.0


def test_a_film_that_the_disk_cannot_hold_is_no_film(
    out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "set"
    shutil.copytree(out, again)
    (again / "dataset.json").unlink()
    film_file = again / "videos" / "train-003000000.mp4"
    size = film_file.stat().st_size
    film_file.unlink()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, before[1]))
    try:
        assert main(["simulate", "--out", str(again), *WORDS]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "out: the video must be writable" in capsys.readouterr().err
    assert not film_file.exists()
    assert not list(again.glob(".partial*"))
