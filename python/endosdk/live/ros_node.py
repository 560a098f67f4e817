"""The depth node's work, the same under ROS 1 and ROS 2: pictures in, messages out. It imports neither.

A host, ``ros1/endosdk_node.py`` or ``ros2/endosdk_ros2/node.py``, hands over pairs of ``sensor_msgs/Image`` and
publishes what comes back. Messages are made with rosbags' definitions; `for_host` copies them into the host's classes.
"""

from __future__ import annotations

import importlib
import json
from array import array
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from endosdk.calibration.rig import StereoCalibration
from endosdk.live.recording.bags import type_store
from endosdk.live.recording.messages import LEFT, RIGHT, TOPICS, MessageMaker
from endosdk.live.recording.result_line import said_of
from endosdk.live.sources.bag import MOST_APART_NS, picture_of
from endosdk.runtime.estimator import DepthEstimator

INPUTS = ("/stereo/left/image_raw", "/stereo/right/image_raw")
# The driver of the cameras has camera_info of its own beside its pictures: that of the rig must not mix with it.
CAMERAS = {side: f"/stereo/rig/{side}/camera_info" for side in ("left", "right")}
# Topic and type of what is published.
OUTPUTS = {
    **{topic: TOPICS[topic] for topic in ("/stereo/depth", "/stereo/disparity", "/stereo/points", "/stereo/result")},
    **dict.fromkeys(CAMERAS.values(), TOPICS["/stereo/left/camera_info"]),
}
MOST_APART_S = MOST_APART_NS / 1e9


def class_of(name: str) -> Any:
    """Return the host's class for a name such as sensor_msgs/msg/Image; both hosts keep it in the same module."""
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


def opened(model: str, calibration: str) -> DepthEstimator:
    """Return the estimator that a host's parameters name; without a calibration, pairs must come rectified."""
    return DepthEstimator(model, calibration=StereoCalibration.load(calibration) if calibration else None)


def for_host(answers: dict[str, Any], class_of: Callable[[str], Any] = class_of) -> Iterator[tuple[str, Any]]:
    """Yield each topic with its message as one of the host's classes, which ``class_of`` finds."""
    for topic, message in answers.items():
        yield topic, filled(message, class_of(OUTPUTS[topic])(), class_of)


class DepthNode:
    """Answers pairs of pictures with the messages of `OUTPUTS`."""

    def __init__(self, estimator: DepthEstimator, *, ros1: bool) -> None:
        self._estimator = estimator
        self._types: Any = type_store(ros1).types
        self._make = MessageMaker(self._types, ros1)

    def answer(self, left: Any, right: Any) -> dict[str, Any]:
        """Return the messages for a pair of ``sensor_msgs/Image``, by topic; they carry the stamp of the left one."""
        views = [picture_of(message, topic) for message, topic in zip((left, right), INPUTS, strict=True)]
        result = self._estimator.predict(*views)
        at = stamp_ns(left.header.stamp)
        line = {"number": result.frame, "stamp_ns": at, **said_of(result)}
        answers = {"/stereo/result": self._types["std_msgs/msg/String"](data=json.dumps(line))}
        rig, geometry = self._estimator.calibration, result.geometry
        disparity = np.where(result.reasons == 0, result.disparity, np.float32(np.nan))
        answers["/stereo/disparity"] = self._make.disparity(at, disparity, geometry)
        if rig is not None and geometry is not None:
            answers[CAMERAS["left"]] = self._make.camera(at, LEFT, rig, geometry)
            answers[CAMERAS["right"]] = self._make.camera(at, RIGHT, rig, geometry)
            answers["/stereo/depth"] = self._make.map(at, result.depth / np.float32(1000))
            answers["/stereo/points"] = self._make.points(at, result.depth, geometry)
        return answers


def stamp_ns(stamp: Any) -> int:
    """Return a ROS time in ns: that of rosbags and ROS 2 has ``sec``, that of ROS 1 ``secs``."""
    if hasattr(stamp, "secs"):
        return int(stamp.secs) * 10**9 + int(stamp.nsecs)
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def filled(message: Any, target: Any, class_of: Callable[[str], Any]) -> Any:
    """Copy a message of rosbags into one of the host's classes and return it.

    ``class_of`` returns the host's class for a name such as ``sensor_msgs/msg/PointField``, for lists of messages.
    """
    if hasattr(target, "secs") or hasattr(target, "nanosec"):
        first, second = ("secs", "nsecs") if hasattr(target, "secs") else ("sec", "nanosec")
        setattr(target, first, message.sec)
        setattr(target, second, message.nanosec)
        return target
    # Constants of a message, which are read-only, and the name of its type belong to the class.
    for name in (field.name for field in fields(message) if not hasattr(type(message), field.name)):
        value = getattr(message, name)
        if hasattr(value, "__msgtype__"):
            filled(value, getattr(target, name), class_of)
        elif isinstance(value, list) and value and hasattr(value[0], "__msgtype__"):
            setattr(target, name, [filled(one, class_of(one.__msgtype__)(), class_of) for one in value])
        elif isinstance(value, np.ndarray):
            setattr(target, name, _numbers(value, getattr(target, name)))
        else:
            setattr(target, name, value)
    return target


def _numbers(values: np.ndarray[Any, Any], blank: object) -> Any:
    """Return an array as the host's class takes it; ``blank`` is what its field holds when it is new.

    ROS 2 has arrays of Python there. It takes bytes too, but looks at each of them in Python: seconds for a frame.
    """
    if isinstance(blank, array):
        return array(blank.typecode, values.tobytes())
    return values.tobytes() if values.dtype == np.uint8 else values.tolist()
