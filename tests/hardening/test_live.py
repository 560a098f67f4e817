"""What live work reads of strangers: recordings, messages of ROS, and what is sent to the page's socket."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest

from endosdk.errors import InvalidArgument, SourceFailed
from endosdk.live.frames import Frame
from endosdk.live.recording.record import begun
from endosdk.live.recording.recorder import line_of
from endosdk.live.recording.recording import Recording
from endosdk.live.recording.texts import parse_line
from endosdk.live.sources.bag import picture_of
from endosdk.live.viewer import Server
from tests.hardening.targets import TARGETS, VIEWS, small_result
from tests.hardening.test_pictures import encoded, png_of

DEEP = 100_000
NESTED = "[" * DEEP + "]" * DEEP


@pytest.mark.parametrize("name", ["record of a recording", "lines of a recording", "message of the page"])
@pytest.mark.parametrize("text", [NESTED, '{"a": ' * DEEP + "1" + "}" * DEEP, "9" * 5000, "null", "\ufffe", ""])
def test_json_that_does_harm_is_refused(name: str, text: str) -> None:
    with pytest.raises((SourceFailed, InvalidArgument)):
        TARGETS[name].try_bytes((text + "\n").encode() if text else b"{}")


def test_what_goes_on_refuses_lines_of_a_stranger(tmp_path) -> None:
    (tmp_path / "frames.jsonl").write_text(NESTED)
    with pytest.raises(InvalidArgument, match=r"^out: frames\.jsonl must be what this command wrote"):
        begun(tmp_path)


def test_fewer_pictures_than_lines_are_a_damaged_recording(tmp_path) -> None:
    for name in ("record of a recording", "lines of a recording"):
        (tmp_path / TARGETS[name].file).write_bytes(TARGETS[name].seed())
    with pytest.raises(SourceFailed, match="damaged"):
        list(Recording(tmp_path).maps())


def test_a_tag_that_nests_too_deeply_to_be_read_back_is_kept_as_text() -> None:
    tag: Any = 1
    for _ in range(40):
        tag = [tag]
    line = parse_line(json.dumps(line_of(Frame(*VIEWS, 0, 0, tag), small_result())))
    assert line["tag"] == repr(tag)


@pytest.mark.parametrize("data", [b"", encoded(".png")[:-20], png_of(40_000, 40_000), b"\xff\xd8\xff"], ids=len)
def test_a_compressed_picture_of_ros_is_whole_and_no_larger_than_any_camera(data: bytes) -> None:
    with pytest.raises(SourceFailed, match="source: /left must "):
        picture_of(SimpleNamespace(format="png", data=data), "/left")


@pytest.mark.parametrize("false", [{"width": 7}, {"width": 0}, {"height": 0}, {"step": 17}, {"height": 2**31}], ids=str)
def test_a_raw_picture_of_ros_has_the_size_that_it_states(false: dict[str, int]) -> None:
    message = {"width": 6, "height": 4, "step": 18, "encoding": "rgb8", "data": bytes(72)}
    assert picture_of(SimpleNamespace(**message), "/left").shape == (4, 6, 3)
    with pytest.raises(SourceFailed, match="source: /left must "):
        picture_of(SimpleNamespace(**(message | false)), "/left")


def test_the_server_answers_a_message_that_does_harm() -> None:
    server = Server.__new__(Server)  # without its socket
    assert "nest" in server._obey(NESTED, SimpleNamespace(shown=None))["refused"]
