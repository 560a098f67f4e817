"""MCAP files and ROS bags, out: the messages of a recording through ``rosbags`` and ``mcap``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from endosdk.errors import DependencyMissing, StorageFailed
from endosdk.io.extras import must_install
from endosdk.live.recording.messages import TOPICS, messages
from endosdk.live.recording.recording import Recording


def write_bag(recording: Recording, partial: Path, out: Path) -> None:
    """Write ``.mcap``, ``.bag`` (ROS 1), or else a folder (ROS 2), at ``partial``, which becomes ``out``.

    Raises StorageFailed, DependencyMissing.
    """
    ending = out.suffix.lower()
    try:
        if ending == ".mcap":
            _write_mcap(recording, partial)
        elif ending == ".bag":
            _write_rosbag(recording, partial, ros1=True)
        else:
            # The files of a ROS 2 bag are named after its folder, so it is written into one of the final name.
            named = partial / out.name
            partial.mkdir()
            _write_rosbag(recording, named, ros1=False)
            for file in named.iterdir():
                file.rename(partial / file.name)
            named.rmdir()
    except OSError as error:
        raise StorageFailed("out", "must be writable", f"{out}: {error}") from error


def type_store(ros1: bool) -> Any:
    """Return the definitions of ROS messages. Raises DependencyMissing."""
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DependencyMissing("bag", f"needs rosbags, which {must_install('live')}", error) from error
    return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)


def _write_mcap(recording: Recording, out: Path) -> None:
    """MCAP with the messages of ROS 2 in their own encoding."""
    from mcap.writer import Writer

    store = type_store(ros1=False)
    with out.open("wb") as file:
        writer: Any = Writer(file)
        writer.start(profile="ros2", library="endosdk")
        channels: dict[str, int] = {}
        for number, message in enumerate(messages(recording, store.types, ros1=False)):
            kind = TOPICS[message.topic]
            if message.topic not in channels:
                definition = store.generate_msgdef(kind, ros_version=2)[0]
                schema = writer.register_schema(kind, "ros2msg", definition.encode())
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message.content, kind))
            writer.add_message(channels[message.topic], message.stamp_ns, data, message.stamp_ns, number)
        writer.finish()


def _write_rosbag(recording: Recording, out: Path, ros1: bool) -> None:
    store = type_store(ros1)
    if ros1:
        from rosbags.rosbag1 import Writer as Bag

        writer: Any = Bag(out)
        serialize = store.serialize_ros1
    else:
        from rosbags.rosbag2 import Writer as Bag2

        writer = Bag2(out, version=9)
        serialize = store.serialize_cdr
    with writer:
        connections: dict[str, Any] = {}
        for message in messages(recording, store.types, ros1):
            kind = TOPICS[message.topic]
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(message.topic, kind, typestore=store)
            writer.write(connections[message.topic], message.stamp_ns, serialize(message.content, kind))
