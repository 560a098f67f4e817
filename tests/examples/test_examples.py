"""The examples run as they stand."""

from __future__ import annotations

import subprocess
import sys

import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from endosdk import StereoCalibration
from endosdk.cli import main
from tests.conftest import ROOT, TINY_MODEL
from tests.live.videos import side_by_side, views, write

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


def ran(name: str, *words) -> str:
    program = [sys.executable, str(ROOT / "examples" / name), *map(str, words)]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_video_to_cloud(folder):
    told = ran("video_to_cloud.py", folder / "v.mkv", folder / "rig.json", folder / "out.ply")
    assert "frame 2, 0.08 s" in told
    assert (folder / "out.ply").stat().st_size > 15 * 1000


def test_measure():
    told = ran("measure.py", DATA / "demo" / "left.png", DATA / "demo" / "right.png", DATA / "rig.json")
    assert [line.split()[0] for line in told.splitlines()] == ["depth", "distance", "area", "relief"]
    assert told.count("95 % within") == 4


def test_bag_to_depth_bag(folder):
    ran("bag_to_depth_bag.py", folder / "in.bag", folder / "rig.json", folder / "out.mcap")
    with AnyReader([folder / "out.mcap"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        counts = {each.topic: each.msgcount for each in reader.connections}
    assert counts["/stereo/depth"] == counts["/stereo/points"] == counts["/stereo/left/image_raw"] == 3
