"""What reads bytes of strangers, a valid example for each, and ways to spoil one."""

from __future__ import annotations

import io
import json
import os
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from hypothesis import strategies as st

from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.datasets.dataset import read_disparity, read_record, read_sample
from endosdk.datasets.layouts.pfm import read_pfm
from endosdk.io.picture_pairs import pair_pictures
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Frame
from endosdk.live.recording.bags import type_store
from endosdk.live.recording.messages import MessageMaker
from endosdk.live.recording.recorder import line_of
from endosdk.live.recording.recording import Recording
from endosdk.live.recording.sixteen_bits import STEPS
from endosdk.live.recording.texts import FORMAT_VERSION, LINES, RECORD
from endosdk.live.sources.bag import CHANNELS, Bag, picture_of
from endosdk.live.viewer.measuring import measured
from endosdk.live.viewer.player import Shown
from endosdk.live.viewer.wishes import parse_wish
from endosdk.runtime.models import read_model
from endosdk.runtime.session import StereoSession
from tests.conftest import TINY_MODEL, shifted_pair, textured_picture
from tests.rigs import raw_rig


@dataclass(frozen=True)
class Target:
    """A reader, and the name under which it finds its file."""

    name: str
    file: str
    seed: Callable[[], bytes]
    read: Callable[[Path], object]

    def try_bytes(self, data: bytes) -> object:
        """Read the bytes as a file; whatever the reader raises comes through."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / self.file
            path.write_bytes(data)
            return self.read(path)


def _own_rig() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        raw_rig().save(Path(folder) / "rig.json")
        return (Path(folder) / "rig.json").read_bytes()


def _opencv(ending: str) -> Callable[[], bytes]:
    @cache
    def write() -> bytes:
        rig = raw_rig()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"rig{ending}"
            storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
            for name, value in (
                ("M1", rig.left_matrix),
                ("D1", rig.left_distortion),
                ("M2", rig.right_matrix),
                ("D2", rig.right_distortion),
                ("R", rig.rotation),
                ("T", rig.translation),
                ("imageSize", np.array([[rig.width, rig.height]])),
            ):
                storage.write(name, np.array(value))
            storage.release()
            return path.read_bytes()

    return write


def _kalibr() -> bytes:
    camera = (
        "  camera_model: pinhole\n  intrinsics: [420.0, 421.0, 320.1, 240.2]\n  distortion_model: radtan\n"
        "  distortion_coeffs: [-0.2, 0.1, 0.001, 0.0]\n  resolution: [640, 480]\n"
    )
    turn = "  T_cn_cnm1: [[1, 0, 0, -0.0045], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    return f"cam0:\n{camera}cam1:\n{camera}{turn}".encode()


def _ros() -> bytes:
    def numbers(name: str, rows: int, columns: int, data: list[float]) -> str:
        return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: {data}\n"

    return (
        "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
        + numbers("camera_matrix", 3, 3, [420, 0, 320, 0, 420, 240, 0, 0, 1])
        + numbers("distortion_coefficients", 1, 5, [-0.2, 0.1, 0, 0, 0])
        + numbers("rectification_matrix", 3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
        + numbers("projection_matrix", 3, 4, [420, 0, 320, 0, 0, 420, 240, 0, 0, 0, 1, 0])
    ).encode()


def _ros_pair(path: Path) -> object:
    right = path.with_name("right.yaml")
    right.write_bytes(_ros().replace(b"420, 0, 320, 0, 0,", b"420, 0, 320, -1.89, 0,"))
    return StereoCalibration.load((path, right))


def _picture(ending: str) -> Callable[[], bytes]:
    @cache
    def write() -> bytes:
        done, data = cv2.imencode(ending, textured_picture(24, 32))
        assert done
        return bytes(data.tobytes())

    return write


def _disparity() -> bytes:
    done, data = cv2.imencode(".png", np.full((24, 32), 1280, np.uint16))
    assert done
    return bytes(data.tobytes())


def _pfm() -> bytes:
    return b"Pf\n8 6\n-1.0\n" + np.arange(48, dtype="<f4").tobytes()


def _sample(path: Path) -> object:
    for name in ("left.png", "right.png"):
        path.with_name(name).write_bytes(_picture(".png")())
    path.with_name("disparity.png").write_bytes(_disparity())
    return read_sample(path.parent)


def _sample_record() -> bytes:
    camera = {"width": 32, "height": 24, "focal_px": 400.0, "baseline_mm": 4.5, "doffs": 0.0}
    return json.dumps({"id": "1", "camera": camera, "info": {}}).encode()


def _set_record() -> bytes:
    samples = {"train": {"000000001": "0" * 64}, "test": {}}
    return json.dumps({"format_version": 1, "name": "x", "samples": samples}).encode()


def _open_model(path: Path) -> object:
    return StereoSession(read_model(path), threads=1)


def _checkpoint() -> bytes:
    import torch
    from safetensors.torch import save

    from endosdk.training.config import TrainConfig

    config = json.dumps(TrainConfig().as_dict())
    header = {"format": "1", "config": config, "step": "7", "state": json.dumps({"seconds": 1.5})}
    return bytes(save({"network.weight": torch.zeros(2)}, metadata=header))


def _open_checkpoint(path: Path) -> object:
    from endosdk.training import checkpoint

    return checkpoint.load(path)


def _pictures_named(path: Path) -> object:
    """Take the bytes as the names of pictures, one a line."""
    root = path.parent / "pictures"
    for side in ("left", "right"):
        (root / side).mkdir(parents=True)
        for line in path.read_bytes().split(b"\n"):
            name = line.replace(b"/", b"_").replace(b"\0", b"_")[:200]
            if name not in (b"", b".", b".."):
                (root / side / os.fsdecode(name)).touch()
    return pair_pictures(root / "left", root / "right")


VIEWS = shifted_pair(96, 160, 10)
SMALL_RIG = StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(160, 96))


@cache
def small_result() -> DepthResult:
    """The depth of `VIEWS`."""
    with DepthEstimator(TINY_MODEL, calibration=SMALL_RIG, threads=1) as estimator:
        return estimator.predict(*VIEWS)


def _recording_record() -> bytes:
    settings = {
        "source": "camera", "clock": "medium", "calibration": SMALL_RIG.content(), "pictures": False, "temporal": False,
        "map": {"name": "depth", "unit": "mm", "step": STEPS["depth"]},
    }  # fmt: skip
    record = {"format_version": FORMAT_VERSION, "settings": settings, "complete": True, "source_ended": True}
    return json.dumps(record).encode()


def _recording_lines() -> bytes:
    frames = (Frame(*VIEWS, number, number * 40_000_000, {"arm": number}) for number in range(2))
    return "".join(json.dumps(line_of(frame, small_result())) + "\n" for frame in frames).encode()


def _open_recording(path: Path) -> object:
    for name, seed in ((RECORD, _recording_record), (LINES, _recording_lines)):
        if name != path.name:
            path.with_name(name).write_bytes(seed())
    recording = Recording(path.parent)
    return recording.lines, recording.calibration


@cache
def _mcap() -> bytes:
    """Two pairs of raw pictures in the encoding of ROS 2."""
    from mcap.writer import CompressionType, Writer

    store, file = type_store(ros1=False), io.BytesIO()
    make, kind = MessageMaker(store.types, ros1=False), "sensor_msgs/msg/Image"
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start(profile="ros2")
    schema = writer.register_schema(kind, "ros2msg", store.generate_msgdef(kind, ros_version=2)[0].encode())
    for side, view in zip(("left", "right"), shifted_pair(12, 16, 4), strict=True):
        channel = writer.register_channel(f"/{side}", "cdr", schema)
        for at in (1, 40_000_001):
            writer.add_message(channel, at, bytes(store.serialize_cdr(make.picture(at, side, view), kind)), at)
    writer.finish()
    return file.getvalue()


ROS_IMAGE = struct.Struct("<IIIB")  # height, width, bytes of a row, encoding; then the pixels


def _ros_image() -> bytes:
    return ROS_IMAGE.pack(4, 6, 18, 0) + bytes(range(72))


def _open_ros_image(path: Path) -> object:
    data = path.read_bytes()
    height, width, step, encoding = ROS_IMAGE.unpack(data[: ROS_IMAGE.size].ljust(ROS_IMAGE.size, b"\0"))
    name = [*CHANNELS, "mono16"][encoding % (len(CHANNELS) + 1)]
    pixels = data[ROS_IMAGE.size :]
    return picture_of(SimpleNamespace(height=height, width=width, step=step, encoding=name, data=pixels), "/left")


def _open_ros_compressed(path: Path) -> object:
    return picture_of(SimpleNamespace(format="png", data=path.read_bytes()), "/left")


def _page_message() -> bytes:
    return json.dumps({"do": "measure", "kind": "point", "pixels": [[80, 50.5]], "id": 7}).encode()


def _obey(path: Path) -> object:
    wish = parse_wish(path.read_bytes().decode(errors="replace"))
    if wish["do"] != "measure":
        return wish
    shown = Shown(Frame(*VIEWS, 0, 0), small_result(), 1, 5.0, 20.0)
    return measured(shown, wish["kind"], wish["pixels"])


TARGETS = {
    target.name: target
    for target in (
        Target("endosdk rig file", "rig.json", _own_rig, StereoCalibration.load),
        Target("OpenCV YAML", "rig.yml", _opencv(".yml"), StereoCalibration.load),
        Target("OpenCV XML", "rig.xml", _opencv(".xml"), StereoCalibration.load),
        Target("OpenCV JSON", "rig.json", _opencv(".json"), StereoCalibration.load),
        Target("Kalibr camchain", "rig.yaml", _kalibr, StereoCalibration.load),
        Target("ROS camera_info", "left.yaml", _ros, _ros_pair),
        Target(
            "FoundationStereo text",
            "K.txt",
            lambda: b"420 0 320 0 420 240 0 0 1\n0.0045\n",
            lambda path: StereoCalibration.load(path, size=(640, 480)),
        ),
        Target("PNG picture", "left.png", _picture(".png"), read_frame),
        Target("JPEG picture", "left.jpg", _picture(".jpg"), read_frame),
        Target("TIFF picture", "left.tif", _picture(".tif"), read_frame),
        Target("BMP picture", "left.bmp", _picture(".bmp"), read_frame),
        Target("PPM picture", "left.ppm", _picture(".ppm"), read_frame),
        Target("disparity picture", "disparity.png", _disparity, read_disparity),
        Target("PFM map", "disp0.pfm", _pfm, read_pfm),
        Target("sample.json", "sample.json", _sample_record, _sample),
        Target("dataset.json", "dataset.json", _set_record, lambda path: read_record(path.parent)),
        Target("names of pictures", "names", lambda: b"left_001.png\nleft_002.png", _pictures_named),
        Target("training checkpoint", "last.safetensors", _checkpoint, _open_checkpoint),
        Target("model file", "model.onnx", lambda: TINY_MODEL.read_bytes(), _open_model),
        Target("record of a recording", RECORD, _recording_record, _open_recording),
        Target("lines of a recording", LINES, _recording_lines, _open_recording),
        Target("MCAP file", "stereo.mcap", _mcap, lambda path: list(Bag(path))),
        Target("ROS Image", "message", _ros_image, _open_ros_image),
        Target("ROS CompressedImage", "message", _picture(".png"), _open_ros_compressed),
        Target("message of the page", "message", _page_message, _obey),
    )
}

# Words that mean something to one of the parsers.
WORDS = [
    *(b"[", b"]", b"{", b"}", b":", b",", b'"', b"'", b"\\", b"\n", b"\0", b"\xff", b"&a ", b"*a", b"<<: ", b"!!x "),
    *(
        b"- ",
        b"nan",
        b"inf",
        b"-1",
        b"0",
        b"1e999",
        b"9" * 400,
        b"null",
        b"true",
        b"1_0",
        b"0x10",
        b".5.",
        b"2001-01-01",
    ),
    *(b"<_>", b"</_>", b"<!DOCTYPE x>", b"&amp;", b"<![CDATA[", b"%YAML:1.0\n", b"---\n", b"\t", b"\xed\xa0\x80"),
    *(b"\\ud800", b"\xef\xbb\xbf", b"IEND", b"IHDR", b"\xff\xd9", b"\xff\xda", b"\xff\xc0"),
    *(b"\x00\x00\x00\x00", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff"),
]


@st.composite
def spoilt(draw: st.DrawFn, seed: bytes) -> bytes:
    """Return a valid example after one to six edits; now and then, bytes that never were one."""
    if draw(st.integers(0, 19)) == 0:
        return draw(st.binary(max_size=400))
    data = bytearray(seed)
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, max(0, len(data) - 1)))
        length = draw(st.integers(0, 40))
        kind = draw(st.sampled_from(["flip", "cut", "word", "twice", "end"]))
        if kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "cut":
            del data[at : at + length]
        elif kind == "word":
            data[at : at + draw(st.integers(0, 8))] = draw(st.sampled_from(WORDS))
        elif kind == "twice":
            data[at:at] = data[at : at + length] * draw(st.integers(1, 50))
        else:
            del data[at:]
    return bytes(data)
