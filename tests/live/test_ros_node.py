"""The ROS nodes' work against the real definitions of the messages, and the ROS 1 node against a real master."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from array import array
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.live.recording.bags import type_store
from endosdk.live.recording.messages import MessageMaker
from endosdk.live.ros_node import OUTPUTS, DepthNode, for_host, stamp_ns
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

STAMP = 1_700_000_123_456_789_012
SYSTEM_PACKAGES = Path("/usr/lib/python3/dist-packages")
RIG = {"focal_px": 200.0, "baseline_mm": 5.0, "size": (160, 96)}


def images(ros1: bool) -> tuple[Any, Any]:
    make = MessageMaker(type_store(ros1).types, ros1)
    return tuple(make.picture(STAMP, side, view) for side, view in zip("lr", shifted_pair(96, 160, 10), strict=True))


@pytest.mark.parametrize("ros1", [True, False])
def test_depth_follows_from_the_disparity_image_alone(ros1: bool) -> None:
    shifted = StereoCalibration.rectified(**RIG, doffs=3.0)
    answers = DepthNode(DepthEstimator(str(TINY_MODEL), calibration=shifted, threads=1), ros1=ros1).answer(
        *images(ros1)
    )
    message, depth = (answers[f"/stereo/{name}"] for name in ("disparity", "depth"))
    found, metres = (np.frombuffer(each.data, np.float32) for each in (message.image, depth))
    known = np.isfinite(metres)
    assert known.mean() > 0.3
    baseline = message.T if ros1 else message.t
    np.testing.assert_allclose(message.f * baseline / found[known], metres[known], rtol=1e-5)


@pytest.fixture(scope="module")
def rig() -> StereoCalibration:
    return StereoCalibration.rectified(**RIG)


@pytest.mark.parametrize("ros1", [True, False], ids=["ros1", "ros2"])
def test_answers_are_messages_of_the_real_definitions(rig: StereoCalibration, ros1: bool) -> None:
    """rosbags holds the definitions that ROS ships: what it can write and read back, ROS can too."""
    store = type_store(ros1)
    estimator = DepthEstimator(str(TINY_MODEL), calibration=rig)
    answers = DepthNode(estimator, ros1=ros1).answer(*images(ros1))
    assert set(answers) == set(OUTPUTS)
    for topic, message in answers.items():
        write, read = (
            (store.serialize_ros1, store.deserialize_ros1) if ros1 else (store.serialize_cdr, store.deserialize_cdr)
        )
        again = read(bytes(write(message, OUTPUTS[topic])), OUTPUTS[topic])
        if topic != "/stereo/result":
            assert stamp_ns(again.header.stamp) == STAMP
    expected = estimator.predict(*shifted_pair(96, 160, 10))
    depth = np.frombuffer(answers["/stereo/depth"].data.tobytes(), "<f4").reshape(96, 160)
    np.testing.assert_allclose(depth * 1000, expected.depth, rtol=1e-6)
    said = json.loads(answers["/stereo/result"].data)
    assert said["status"] == expected.status.name
    assert said["valid_share"] == pytest.approx(expected.valid_share, abs=1e-4)


def test_without_a_rig_there_is_disparity_alone() -> None:
    answers = DepthNode(DepthEstimator(str(TINY_MODEL)), ros1=False).answer(*images(ros1=False))
    assert set(answers) == {"/stereo/disparity", "/stereo/result"}


def test_pictures_of_an_encoding_that_is_not_known_are_refused() -> None:
    left, right = images(ros1=False)
    left.encoding = "bayer_rggb8"
    with pytest.raises(InvalidArgument, match="bayer_rggb8"):
        DepthNode(DepthEstimator(str(TINY_MODEL)), ros1=False).answer(left, right)


TYPE_CODES = {"uint8": "B", "float64": "d"}  # of the arrays that rclpy's messages hold


def host_class(kind: str, ros1: bool) -> Any:
    """A blank object with the fields of a message of the host, as rospy and rclpy make them."""
    if kind.endswith("/Time"):
        return SimpleNamespace(secs=0, nsecs=0) if ros1 else SimpleNamespace(sec=0, nanosec=0)
    fields = type_store(ros1).fielddefs[kind][1]
    # As in a host's class, there is nothing else to be set: constants of a message are no fields.
    blank = type("Message", (), {"__slots__": [name for name, _ in fields]})()
    for name, (node, description) in fields:
        value = host_class(description, ros1) if node.name == "NAME" else None
        if node.name == "SEQUENCE" and not ros1 and description[0][1][0] in TYPE_CODES:
            value = array(TYPE_CODES[description[0][1][0]])
        setattr(blank, name, value)
    return blank


@pytest.mark.parametrize("ros1", [True, False], ids=["ros1", "ros2"])
def test_every_field_reaches_the_hosts_classes(rig: StereoCalibration, ros1: bool) -> None:
    answers = DepthNode(DepthEstimator(str(TINY_MODEL), calibration=rig), ros1=ros1).answer(*images(ros1))
    targets = dict(for_host(answers, lambda name: lambda: host_class(name, ros1)))
    assert set(targets) == set(OUTPUTS)
    for topic, target in targets.items():
        for name in (name for name, _ in type_store(ros1).fielddefs[OUTPUTS[topic]][1]):
            assert getattr(target, name) is not None, (topic, name)
        if topic != "/stereo/result":
            assert stamp_ns(target.header.stamp) == STAMP
    cloud = targets["/stereo/points"]
    assert [field.name for field in cloud.fields] == ["x", "y", "z"]
    assert len(cloud.data) == cloud.row_step
    left = targets["/stereo/rig/left/camera_info"]
    if ros1:
        assert isinstance(cloud.data, bytes)
    else:  # what rclpy takes without a look at each byte
        assert [given.typecode for given in (cloud.data, left.d)] == ["B", "d"]


CLIENT = """
import sys
import numpy as np, rospy
from sensor_msgs.msg import Image, PointCloud2
from stereo_msgs.msg import DisparityImage
rospy.init_node("client")
got = {}
rospy.Subscriber("/stereo/depth", Image, lambda m: got.update(depth=m))
rospy.Subscriber("/stereo/disparity", DisparityImage, lambda m: got.update(disparity=m))
rospy.Subscriber("/stereo/points", PointCloud2, lambda m: got.update(points=m))
out = [rospy.Publisher(f"/stereo/{side}/image_raw", Image, queue_size=1) for side in ("left", "right")]
views = np.load(sys.argv[1])
end = rospy.Time.now() + rospy.Duration(60)
while len(got) < 3 and rospy.Time.now() < end and not rospy.is_shutdown():
    at = rospy.Time.now()
    for publisher, view in zip(out, views):
        m = Image(height=view.shape[0], width=view.shape[1], encoding="rgb8", step=3 * view.shape[1])
        m.data, m.header.stamp = view.tobytes(), at
        publisher.publish(m)
    rospy.sleep(0.2)
depth = np.frombuffer(got["depth"].data, "<f4").reshape(got["depth"].height, got["depth"].width)
np.save(sys.argv[2], depth)
print("frame", got["depth"].header.frame_id, "T", round(got["disparity"].T, 6))
print("points of", [field.name for field in got["points"].fields], len(got["points"].data) // got["points"].row_step)
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def answers_at(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.slow
def test_the_ros_1_node_under_a_real_master(rig: StereoCalibration, tmp_path: Path) -> None:
    """Debian's ros-core: rosmaster, the node, and a client that publishes pictures and receives depth."""
    master = shutil.which("rosmaster")
    if master is None or not (SYSTEM_PACKAGES / "message_filters").is_dir():
        pytest.skip("ROS 1 is not on this machine: apt install ros-core python3-message-filters python3-stereo-msgs")
    port = free_port()
    paths = os.pathsep.join([str(ROOT / "python"), *(p for p in sys.path if p), str(SYSTEM_PACKAGES)])
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(tmp_path),
        "PYTHONPATH": paths,
    }
    rig.save(tmp_path / "rig.json")
    left, right = shifted_pair(96, 160, 10)
    np.save(tmp_path / "views.npy", np.stack([left, right]))
    (tmp_path / "client.py").write_text(CLIENT)
    running = [subprocess.Popen([master, "--core", "-p", str(port)], env=environment)]
    try:
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and not answers_at(port):
            time.sleep(0.2)
        node = [sys.executable, ROOT / "ros1" / "endosdk_node.py"]
        options = [f"_calibration:={tmp_path / 'rig.json'}", f"_model:={TINY_MODEL}"]
        running.append(subprocess.Popen([*node, *options], env=environment))
        client = [sys.executable, tmp_path / "client.py", tmp_path / "views.npy", tmp_path / "depth.npy"]
        done = subprocess.run(client, env=environment, capture_output=True, text=True, timeout=180)
        assert done.returncode == 0, done.stderr
        assert "frame endosdk_left T 0.005" in done.stdout
        assert "points of ['x', 'y', 'z']" in done.stdout
    finally:
        for process in reversed(running):
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:  # the master sometimes waits for its own threads for ever
                process.kill()
                process.wait()
    expected = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(left, right).depth
    np.testing.assert_allclose(np.load(tmp_path / "depth.npy") * 1000, expected, rtol=1e-5)
