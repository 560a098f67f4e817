"""The examples run as they stand."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from endosdk import DepthEstimator, StereoCalibration
from endosdk.calibration.boards import Board
from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.io.pictures import write_picture
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.live.videos import side_by_side, views, write
from tests.rendered_boards import POSES, shown
from tests.rigs import raw_rig

DATA = ROOT / "examples" / "data"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A video, its rig, and a ROS 1 bag of it."""
    folder = tmp_path_factory.mktemp("examples")
    StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(96, 64)).save(folder / "rig.json")
    write(folder / "v.mkv", side_by_side(views(3, 64, 96)))
    words = ["run", str(folder / "v.mkv"), "--calibration", str(folder / "rig.json"), "--model", str(TINY_MODEL)]
    assert main([*words, "--out", str(folder / "in.bag")]) == 0
    return folder


def done(name: str, *words) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, str(ROOT / "examples" / name), *map(str, words)]
    return subprocess.run(program, capture_output=True, text=True, check=False)


def ran(name: str, *words) -> str:
    example = done(name, *words)
    assert example.returncode == 0, example.stderr
    return example.stdout


def test_torch_dataset():
    printed = ran("torch_dataset.py", ROOT / "datasets" / "endosim-gi-cycles", "test").splitlines()
    assert [line.split()[0] for line in printed[:5]] == ["left", "right", "disparity", "known", "occluded"]
    assert printed[0].endswith("[4, 3, 256, 512]") and printed[3].endswith("[4, 256, 512]")
    mean = float(printed[5].removeprefix("mean disparity ").removesuffix(" px"))
    assert 5 < mean < 60  # of whole pairs: 10 to 40 px


def write_set(root, *sizes):
    """Write a set of training pairs of these sizes (height, width)."""
    hashes = {}
    for number, size in enumerate(sizes):
        views = shifted_pair(*size, 5)
        sample = Sample(f"{number:09d}", *views, np.full(size, 5, np.float32), None, None, focal_px=200, baseline_mm=5)
        hashes[sample.id] = write_sample(root, "train", sample)
    samples = {"train": hashes, "test": {}}
    write_dataset_record(root, {"format_version": 1, "name": root.name, "samples": samples})


def test_torch_dataset_stacks_pairs_of_several_sizes(tmp_path):
    write_set(tmp_path / "mixed", (64, 136), (72, 128), (80, 160), (300, 600))
    printed = ran("torch_dataset.py", tmp_path / "mixed").splitlines()
    assert printed[0].endswith("[4, 3, 64, 128]") and printed[4].endswith("[4, 64, 128]")
    assert printed[5] == "mean disparity 5.0 px"


def test_pack_set_says_that_there_are_no_test_pairs(tmp_path):
    write_set(tmp_path / "train-only", (64, 128))
    (tmp_path / "train-only" / "recipe.json").write_text("{}")
    packed = done("pack_set.py", tmp_path / "train-only", tmp_path / "packed")
    assert packed.returncode == 1
    assert packed.stderr.startswith(f"{tmp_path / 'train-only'} has no finished test pairs; endosdk simulate")
    assert packed.stderr.count("\n") == 1
    assert not (tmp_path / "packed").exists()


def test_video_to_cloud(folder):
    printed = ran("video_to_cloud.py", folder / "v.mkv", folder / "rig.json", folder / "out.ply")
    assert "frame 2, 0.08 s" in printed
    assert (folder / "out.ply").stat().st_size > 15 * 1000


def test_measure():
    printed = ran("measure.py", DATA / "demo" / "left.png", DATA / "demo" / "right.png", DATA / "rig.json")
    assert [line.split()[0] for line in printed.splitlines()] == ["depth", "distance", "area", "relief"]
    assert printed.count("95 % within") == 4


def test_bag_to_depth_bag(folder):
    ran("bag_to_depth_bag.py", folder / "in.bag", folder / "rig.json", folder / "out.mcap")
    with AnyReader([folder / "out.mcap"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        counts = {each.topic: each.msgcount for each in reader.connections}
    assert counts["/stereo/depth"] == counts["/stereo/points"] == counts["/stereo/left/image_raw"] == 3


@pytest.mark.slow
def test_boards_to_depth(tmp_path):
    rig = raw_rig(left_distortion=np.array([-0.2, 0.1, 0, 0]), right_distortion=np.array([-0.16, 0.08, 0, 0]))
    board = Board((9, 6), 3.0)
    for number, pose in enumerate(POSES):
        for side, view in zip(("left", "right"), shown(board, rig, pose, seed=number), strict=True):
            (tmp_path / side).mkdir(exist_ok=True)
            write_picture(tmp_path / side / f"{number:02d}.png", view)
    pair = [tmp_path / side / "03.png" for side in ("left", "right")]
    folders = tmp_path / "left", tmp_path / "right"
    told = ran("boards_to_depth.py", *folders, "9x6", 3.0, *pair, tmp_path / "out")
    assert "depth at 60 mm is uncertain by" in told
    found = StereoCalibration.load(tmp_path / "out" / "rig.json")
    assert found.baseline_mm == pytest.approx(rig.baseline_mm, abs=0.05)
    assert "Coverage" in (tmp_path / "out" / "rig.html").read_text()


@pytest.mark.slow
def test_fine_tune_on_renders(tmp_path):
    rig = tmp_path / "rig.json"
    StereoCalibration.rectified(focal_px=256.0, baseline_mm=5.0, size=(512, 384)).save(rig)
    told = ran("fine_tune_on_renders.py", rig, tmp_path / "out", 4, 1)
    assert "px before" in told
    DepthEstimator(str(tmp_path / "out" / "tuned.onnx")).predict(*shifted_pair(384, 512, 8))
