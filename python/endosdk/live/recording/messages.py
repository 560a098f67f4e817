"""A recording as messages of ROS: what Foxglove, RViz and ``ros2 bag`` know how to show.

Lengths are metres there, as by REP 103 and REP 118; a pixel without depth is NaN. Frames of reference: the views are
those of ``endosdk_left`` and ``endosdk_right``, rectified; x right, y down, z forward.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from endosdk.calibration.files.ros import camera_info
from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration
from endosdk.live.frames import Frame, Picture
from endosdk.live.recording.recording import Recording

LEFT, RIGHT = "endosdk_left", "endosdk_right"
TOPICS = {
    "/stereo/left/image_raw": "sensor_msgs/msg/Image",
    "/stereo/right/image_raw": "sensor_msgs/msg/Image",
    "/stereo/left/camera_info": "sensor_msgs/msg/CameraInfo",
    "/stereo/right/camera_info": "sensor_msgs/msg/CameraInfo",
    "/stereo/depth": "sensor_msgs/msg/Image",
    "/stereo/disparity": "stereo_msgs/msg/DisparityImage",
    "/stereo/points": "sensor_msgs/msg/PointCloud2",
    "/stereo/result": "std_msgs/msg/String",
}


class Message(NamedTuple):
    """One message, of the type that `TOPICS` gives its topic."""

    topic: str
    stamp_ns: int
    content: Any


def messages(recording: Recording, types: Any, ros1: bool) -> Iterator[Message]:
    """Yield the messages of a recording in the order of time; ``types`` are the classes of a store of rosbags."""
    make = MessageMaker(types, ros1)
    rig = recording.calibration
    geometry = None if rig is None else rig.rectification()
    frames: Iterator[Frame | None] = iter(recording) if recording.settings["pictures"] else iter(lambda: None, 0)
    for (line, values), frame in zip(recording.maps(), frames, strict=False):
        at = line["stamp_ns"]
        if frame is not None:
            yield Message("/stereo/left/image_raw", at, make.picture(at, LEFT, frame.left))
            yield Message("/stereo/right/image_raw", at, make.picture(at, RIGHT, frame.right))
        if rig is not None and geometry is not None:
            yield Message("/stereo/left/camera_info", at, make.camera(at, LEFT, rig, geometry))
            yield Message("/stereo/right/camera_info", at, make.camera(at, RIGHT, rig, geometry))
            yield Message("/stereo/depth", at, make.map(at, values / np.float32(1000)))
            yield Message("/stereo/disparity", at, make.disparity(at, geometry.disparity_of(values), geometry))
            yield Message("/stereo/points", at, make.points(at, values, geometry))
        else:
            yield Message("/stereo/disparity", at, make.disparity(at, values, None))
        yield Message("/stereo/result", at, types["std_msgs/msg/String"](data=json.dumps(line)))


class MessageMaker:
    """Makes messages of the classes of a store of rosbags, with the fields of ROS 1 or 2."""

    def __init__(self, types: Any, ros1: bool) -> None:
        self._types = types
        self._ros1 = ros1

    def header(self, at: int, frame_id: str) -> Any:
        """Return a header with a stamp in ns."""
        stamp = self._types["builtin_interfaces/msg/Time"](sec=at // 10**9, nanosec=at % 10**9)
        number = {"seq": 0} if self._ros1 else {}
        return self._types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id, **number)

    def picture(self, at: int, frame_id: str, picture: Picture) -> Any:
        """Return RGB as an Image."""
        return self._image(at, frame_id, picture, "rgb8", 3)

    def map(self, at: int, values: npt.NDArray[np.float32]) -> Any:
        """Return float32 as an Image."""
        return self._image(at, LEFT, np.ascontiguousarray(values, np.float32), "32FC1", 4)

    def _image(self, at: int, frame_id: str, array: npt.NDArray[Any], encoding: str, pixel_bytes: int) -> Any:
        height, width = array.shape[:2]
        return self._types["sensor_msgs/msg/Image"](
            header=self.header(at, frame_id),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=0,
            step=width * pixel_bytes,
            data=np.ascontiguousarray(array).reshape(-1).view(np.uint8),
        )

    def camera(self, at: int, frame_id: str, rig: StereoCalibration, geometry: RectifiedGeometry) -> Any:
        """Return a view's CameraInfo; ``frame_id`` says which."""
        info = camera_info(rig, geometry, "left" if frame_id == LEFT else "right")
        values = {"d": info.distortion, "k": info.matrix, "r": info.rectification, "p": info.projection}
        return self._types["sensor_msgs/msg/CameraInfo"](
            header=self.header(at, frame_id),
            height=rig.height,
            width=rig.width,
            distortion_model=info.distortion_model,
            binning_x=0,
            binning_y=0,
            roi=self._region(0, 0, 0, 0),
            **{(name.upper() if self._ros1 else name): value.flatten() for name, value in values.items()},
        )

    def disparity(self, at: int, values: npt.NDArray[np.float32], geometry: RectifiedGeometry | None) -> Any:
        """Return a disparity as DisparityImage, whose depth is f T / d: without the difference of principal points."""
        if geometry is not None:
            values = values + np.float32(geometry.doffs)
        known = values[np.isfinite(values)]
        return self._types["stereo_msgs/msg/DisparityImage"](
            header=self.header(at, LEFT),
            image=self.map(at, values),
            f=0.0 if geometry is None else geometry.focal_px,
            **{("T" if self._ros1 else "t"): 0.0 if geometry is None else geometry.baseline_mm / 1000},
            valid_window=self._region(0, 0, values.shape[0], values.shape[1]),
            min_disparity=float(known.min()) if known.size else 0.0,
            max_disparity=float(known.max()) if known.size else 0.0,
            delta_d=1 / 64,
        )

    def points(self, at: int, depth: npt.NDArray[np.float32], geometry: RectifiedGeometry) -> Any:
        """Return a depth in mm as PointCloud2, without the pixels that have none."""
        rows, columns = np.nonzero(np.isfinite(depth))
        z = depth[rows, columns] / 1000
        x = (columns - geometry.cx) / geometry.focal_px * z
        y = (rows - geometry.cy) / geometry.focal_y_px * z
        points = np.stack([x, y, z], axis=1).astype("<f4")
        field = self._types["sensor_msgs/msg/PointField"]
        return self._types["sensor_msgs/msg/PointCloud2"](
            header=self.header(at, LEFT),
            height=1,
            width=len(points),
            fields=[field(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyz")],
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points),
            data=points.reshape(-1).view(np.uint8),
            is_dense=True,
        )

    def _region(self, x: int, y: int, height: int, width: int) -> Any:
        return self._types["sensor_msgs/msg/RegionOfInterest"](
            x_offset=x, y_offset=y, height=height, width=width, do_rectify=False
        )
