"""ROS 1 and ROS 2 bags and MCAP files as sources: two topics of pictures that belong together by their time stamps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from endosdk.errors import DependencyMissing, EndoError, InvalidArgument, SourceFailed
from endosdk.io.bounded_read import Refused, is_there
from endosdk.io.extras import must_install
from endosdk.io.picture_bytes import check_picture_size, decode_picture
from endosdk.live.frames import Frame, Picture
from endosdk.live.sources.source import DEFAULT_OPTIONS, Clock, Source, SourceOptions

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "8UC1": 1, "8UC3": 3}
MOST_APART_NS = 5_000_000  # of two pictures taken together
MOST_WAITING = 50  # pictures of one side that the other has not answered


def is_bag(path: Path) -> bool:
    """Whether a path is a bag that this reads."""
    return path.suffix.lower() in (".bag", ".mcap") or is_there(path / "metadata.yaml")


class Bag(Source):
    """The one topic with ``left`` in its name and the one with ``right``, raw or compressed pictures of 8 bits.

    Numbers go on over a picture whose partner is lost.
    """

    clock: Clock = "wall"
    reading = ()

    def __init__(self, path: Path, options: SourceOptions = DEFAULT_OPTIONS) -> None:
        super().__init__(str(path), options)
        with self._reader() as reader:
            left, right = (self._topic(reader, side) for side in ("left", "right"))
            # A driver that was started again is another connection to the same topic.
            counts = [sum(each.msgcount for each in reader.connections if each.topic == side) for side in (left, right)]
        self.count = min(counts)
        self._topics = {left: 0, right: 1}

    def _reader(self) -> Any:
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise DependencyMissing("source", f"a bag needs rosbags, which {must_install('live')}", error) from error
        try:
            reader = AnyReader([Path(self.word)], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
        except Exception as error:  # rosbags raises whatever its parsers come upon in a damaged file
            raise SourceFailed("source", "must be a bag that can be read", f"{self.word}: {error!r}") from error
        reader.close()
        return AnyReader([Path(self.word)], default_typestore=get_typestore(Stores.ROS2_HUMBLE))

    def _topic(self, reader: Any, side: str) -> str:
        pictures = sorted({str(each.topic) for each in reader.connections if each.msgtype in (RAW, COMPRESSED)})
        found = [topic for topic in pictures if side in topic.lower()]
        if len(found) != 1:
            topics = ", ".join(pictures) or "no pictures"
            raise InvalidArgument("source", f"must hold one topic of pictures with {side} in its name", topics)
        return found[0]

    def _read(self, start: int) -> Iterator[Frame]:
        number = pairs = 0
        with self._reader() as reader:
            waiting: tuple[deque[tuple[int, Picture]], ...] = deque(), deque()
            for topic, at, picture in self._pictures(reader):
                waiting[self._topics[topic]].append((at, picture))
                for pair in self._together(*waiting):
                    pairs += pair is not None
                    if pair is not None and number >= start:
                        left, right = pair
                        yield Frame(left[1], right[1], number, left[0])
                    number += 1
            for side, alone in zip(("left", "right"), waiting, strict=True):
                for at, _ in alone:
                    self._pass_over(side, at)
            if not pairs:
                raise SourceFailed("source", "both topics must hold pictures of one time", self.word)

    def _pictures(self, reader: Any) -> Iterator[tuple[str, int, Picture]]:
        """Yield the topic of every picture, when it was taken, ns, and the picture."""
        wanted = [each for each in reader.connections if each.topic in self._topics]
        try:
            for connection, received, data in reader.messages(wanted):
                message = reader.deserialize(data, connection.msgtype)
                stamp = message.header.stamp
                at = stamp.sec * 10**9 + stamp.nanosec or received
                yield connection.topic, at, picture_of(message, connection.topic)
        except EndoError:
            raise
        except Exception as error:  # as above; a bag may also define its messages anew, without what is read of them
            raise SourceFailed("source", "must be a bag that can be read", f"{self.word}: {error!r}") from error

    def _together(
        self, left: deque[tuple[int, Picture]], right: deque[tuple[int, Picture]]
    ) -> Iterator[tuple[tuple[int, Picture], tuple[int, Picture]] | None]:
        """Take the pairs out of what waits, and None for a picture whose partner never comes, which is reported."""
        while left and right:
            apart = left[0][0] - right[0][0]
            if abs(apart) <= MOST_APART_NS:
                yield left.popleft(), right.popleft()
            else:
                at, _ = (left if apart < 0 else right).popleft()
                self._pass_over("left" if apart < 0 else "right", at)
                yield None
        for side, alone in (("left", left), ("right", right)):
            if len(alone) > MOST_WAITING:  # as where one camera starts after the other
                self._pass_over(side, alone.popleft()[0])
                yield None

    def _pass_over(self, side: str, at: int) -> None:
        self.note(f"the {side} picture of {at} ns has no partner")


def picture_of(message: Any, topic: str) -> Picture:
    """Return the RGB of an Image or CompressedImage, uint8 [H, W, 3]; ``topic`` names it in errors.

    Raises SourceFailed where it is no whole picture, InvalidArgument for an encoding that is not read.
    """
    content = message.data  # rospy gives bytes, rclpy an array.array, rosbags an array of NumPy
    pixels = np.frombuffer(content, np.uint8) if isinstance(content, bytes) else np.asarray(content, np.uint8)
    try:
        return _decoded(pixels) if hasattr(message, "format") else _unpacked(message, pixels)
    except Refused as refused:
        raise SourceFailed("source", f"{topic} {refused.rule}", refused.value) from refused


def _decoded(content: Picture) -> Picture:
    import cv2

    picture = decode_picture(content.tobytes(), "IMREAD_COLOR|IMREAD_ANYDEPTH")
    if picture.dtype != np.uint8:
        raise InvalidArgument("source", "pictures must have 8 bits a channel", f"{8 * picture.itemsize} bits")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


def _unpacked(message: Any, pixels: Picture) -> Picture:
    if message.encoding not in CHANNELS:
        raise InvalidArgument("source", f"pictures must be one of {', '.join(CHANNELS)}", message.encoding)
    channels = CHANNELS[message.encoding]
    check_picture_size(message.width, message.height)
    if message.step < message.width * channels:
        raise Refused(f"must have rows of {message.width} px of {channels} bytes", f"rows of {message.step} bytes")
    if pixels.size != message.height * message.step:
        raise Refused(f"must hold {message.height} rows of {message.step} bytes", pixels.size)
    rows = pixels.reshape(message.height, message.step)
    picture = rows[:, : message.width * channels].reshape(message.height, message.width, channels)[..., :3]
    if channels == 1:
        picture = np.repeat(picture, 3, axis=2)
    return np.ascontiguousarray(picture[..., ::-1] if message.encoding.startswith("bgr") else picture)
