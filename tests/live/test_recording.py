"""What is recorded comes back: the very frames, the maps to their step, and what bags and MCAP files hold of them."""

from __future__ import annotations

import errno
import fcntl
import io
import json
import math
import shutil
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

import endosdk
from endosdk import DepthEstimator, StereoCalibration
from endosdk.commands.cli import main
from endosdk.errors import InvalidArgument, SourceFailed
from endosdk.io.locks import locked_folder
from endosdk.io.pictures import read_frame, write_picture
from endosdk.io.whole_files import whole_file
from endosdk.live.frames import Frame
from endosdk.live.recording import recorder
from endosdk.live.recording.record import check_out, record
from endosdk.live.recording.recorder import Recorder
from endosdk.live.recording.recording import Recording
from endosdk.live.recording.video_files import VideoWriter
from endosdk.live.silence import told_of_silence
from endosdk.live.sources.bag import picture_of
from endosdk.live.sources.source import Source, SourceOptions
from endosdk.live.sources.video_input import Piped
from endosdk.live.viewer import Player
from tests.conftest import TINY_MODEL, noisy, shifted_pair
from tests.live.videos import side_by_side, views, write

COUNT = 8
PAIRS = views(COUNT, 64, 96)
RIG = StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(96, 64))


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write(tmp_path_factory.mktemp("video") / "v.mkv", side_by_side(PAIRS), stamps=[0, 1, 2, 4, 5, 6, 7, 9])


@pytest.fixture(scope="module")
def recorded(video, tmp_path_factory):
    out = tmp_path_factory.mktemp("recorded") / "r"
    counts = record(endosdk.open_source(video).tagged(lambda f: {"arm": f.number}), estimator(), out)
    assert counts["frames"] == COUNT
    return out


def estimator(rig=RIG):
    return DepthEstimator(str(TINY_MODEL), calibration=rig, threads=1)


def check(path):
    """A recording holds the frames of the video and the depth that `predict` gives for them."""
    recording = Recording(path)
    frames = list(endosdk.open_source(path))
    assert [frame.number for frame in frames] == list(range(COUNT))
    assert [frame.stamp_ns // 40_000_000 for frame in frames] == [0, 1, 2, 4, 5, 6, 7, 9]
    for frame, (left, right) in zip(frames, PAIRS, strict=True):
        assert np.array_equal(frame.left, left)
        assert np.array_equal(frame.right, right)
    assert recording.calibration == RIG
    again = estimator()
    for (line, depth), (left, right) in zip(recording.maps(), PAIRS, strict=True):
        wanted = again.predict(left, right)
        assert line["status"] == wanted.status.name
        assert np.array_equal(np.isfinite(depth), np.isfinite(wanted.depth))
        assert np.nanmax(np.abs(depth - wanted.depth)) <= 0.0501  # half a step of 0.1 mm
    return frames


def test_a_recording_gives_back_the_very_frames(recorded):
    frames = check(recorded)
    assert [frame.tag for frame in frames] == [{"arm": n} for n in range(COUNT)]
    assert sorted(path.name for path in recorded.iterdir()) == [
        ".lock", "depth.mkv", "frames.jsonl", "pair.mkv", "preview.mp4", "recording.json",
    ]  # fmt: skip


def test_every_frame_has_a_line(recorded):
    lines = [json.loads(line) for line in (recorded / "frames.jsonl").read_text().splitlines()]
    assert len(lines) == COUNT
    for line in lines:
        assert set(line["reasons"]) == {reason.name for reason in endosdk.Reason}
        assert line["milliseconds"]["session"] > 0
        assert 0 < line["valid_share"] <= 1


@pytest.mark.parametrize("ending", ["", ".mkv"])
def test_stamps_that_stand_still_where_a_part_ends_are_joined(tmp_path, monkeypatch, ending):
    monkeypatch.setattr(recorder, "PART_FRAMES", 2)

    class Standing(Source):
        def _read(self, start):
            for number, stamp in enumerate((0, 40_000_000, 40_000_000, 40_000_000, 80_000_000)):
                if number >= start:
                    yield Frame(*PAIRS[number], number, stamp)

    assert record(Standing("standing"), estimator(), tmp_path / f"r{ending}")["frames"] == 5
    frames = list(endosdk.open_source(tmp_path / f"r{ending}"))
    assert [frame.stamp_ns for frame in frames] == [0, 40_000_000, 40_000_001, 40_000_002, 80_000_000]


def test_what_a_source_says_of_its_length_is_no_limit(tmp_path):
    class Short(Source):
        count = 3

        def _read(self, start):
            for number in range(start, 5):
                yield Frame(*PAIRS[number], number, 40_000_000 * number)

    assert record(Short("short"), estimator(), tmp_path / "r")["frames"] == 5
    assert record(Short("short"), estimator(), tmp_path / "some", most=4)["frames"] == 4


def test_another_network_size_is_another_recording(video, tmp_path):
    source = endosdk.open_source(video)
    with Recorder(tmp_path / "r", estimator(), source):
        pass
    other = DepthEstimator(str(TINY_MODEL), calibration=RIG, threads=1, network_size=(64, 48))
    with pytest.raises(InvalidArgument, match="network_size"):
        Recorder(tmp_path / "r", other, source)


def test_the_preview_can_be_played(recorded):
    with av.open(str(recorded / "preview.mp4")) as file:
        assert file.streams.video[0].codec_context.name == "h264"
        pictures = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
    assert len(pictures) == COUNT
    assert np.abs(pictures[3][:, :96].astype(int) - PAIRS[3][0]).mean() < 12


def test_the_command_records_and_gives_back(video, tmp_path, capsys):
    RIG.save(tmp_path / "rig.json")
    words = ["run", str(video), "--model", str(TINY_MODEL), "--calibration", str(tmp_path / "rig.json")]
    assert main([*words, "--out", str(tmp_path / "f.mkv")]) == 0
    assert f"frames     {COUNT}" in capsys.readouterr().out
    check(tmp_path / "f.mkv")
    assert main(["replay", str(tmp_path / "f.mkv"), "--out", str(tmp_path / "pictures")]) == 0
    frames = list(endosdk.open_source(tmp_path / "pictures"))
    assert np.array_equal(frames[5].right, PAIRS[5][1])
    assert len(list((tmp_path / "pictures" / "depth").iterdir())) == COUNT


@pytest.mark.parametrize("option", [None, "--temporal", "--no-pictures"])
def test_the_command_records_as_it_is_told(option, tmp_path):
    """One still scene with new noise in every frame, which the filter takes away."""
    pairs = [[noisy(view, 3, 2 * n + eye) for eye, view in enumerate(shifted_pair(96, 160, 8))] for n in range(4)]
    video, out = write(tmp_path / "v.mkv", side_by_side(pairs)), tmp_path / "r"
    words = ["run", str(video), "--model", str(TINY_MODEL), "--threads", "1", "--out", str(out)]
    assert main([*words, *([] if option is None else [option])]) == 0
    recording = Recording(out)
    found = np.stack([disparity for _, disparity in recording.maps()])
    plain, steady = (
        np.stack(
            [
                np.where(result.reasons == 0, result.disparity, np.nan)
                for result in estimator(None).stream(iter(pairs), temporal=on)
            ]
        )
        for on in (False, True)
    )
    wanted, other = (steady, plain) if option == "--temporal" else (plain, steady)
    assert np.array_equal(np.isfinite(found), np.isfinite(wanted))
    assert np.nanmax(np.abs(found - wanted)) <= 1 / 128 + 1e-6 < 0.1 * np.nanmax(np.abs(found - other))
    if option != "--no-pictures":
        assert np.array_equal(next(iter(recording)).left, pairs[0][0])
        return
    assert not (out / "pair.mkv").exists()
    with pytest.raises(SourceFailed, match="recorded without them"):
        next(iter(recording))


def test_the_summary_names_the_causes_and_their_remedies(tmp_path, capsys):
    same = write(tmp_path / "v.mkv", side_by_side([(left, left) for left, _ in PAIRS]))
    words = ["run", str(same), "--model", str(TINY_MODEL), "--out", str(tmp_path / "r")]
    assert main(words) == 1
    remedy = "one camera is connected to both inputs; connect each camera to its own input"
    assert f"cause      SAME_VIEW_TWICE in {COUNT} frames: {remedy}\n" in capsys.readouterr().out
    assert main([*words, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["causes"]["SAME_VIEW_TWICE"] == COUNT


def test_replay_writes_what_the_depth_lies_over(tmp_path):
    """A rig whose raw views are not rectified."""
    rig = replace(RIG, left_distortion=(-0.3, 0.1, 0.0, 0.0), right_distortion=(-0.3, 0.1, 0.0, 0.0))
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS[:2]))
    record(endosdk.open_source(video), estimator(rig), tmp_path / "r")
    out = tmp_path / "pictures"
    assert main(["replay", str(tmp_path / "r"), "--out", str(out)]) == 0
    wanted = estimator(rig).rectify(*PAIRS[1])[0]
    assert np.array_equal(read_frame(out / "left_rectified" / "000001.png"), wanted)
    assert not np.array_equal(wanted, PAIRS[1][0])
    assert StereoCalibration.load(out / "rig.json") == rig
    lines = [json.loads(line) for line in (out / "frames.jsonl").read_text().splitlines()]
    assert lines == Recording(tmp_path / "r").lines
    assert lines[1]["stamp_ns"] == 40_000_000


def test_replay_without_a_rig_writes_no_second_left_view(tmp_path):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS[:2]))
    record(endosdk.open_source(video), estimator(None), tmp_path / "r")
    assert main(["replay", str(tmp_path / "r"), "--out", str(tmp_path / "pictures")]) == 0
    found = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert found == {"left", "right", "disparity", "frames.jsonl"}


@pytest.mark.parametrize("stop", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_replay_that_is_stopped_leaves_no_folder(recorded, tmp_path, capsys, monkeypatch, stop):
    written = []

    def stopped(path, picture):
        if len(written) == COUNT + 3:
            with whole_file(path, "out"):
                raise stop
        written.append(path)
        write_picture(path, picture)

    monkeypatch.setattr("endosdk.io.pictures.write_picture", stopped)
    words = ["replay", str(recorded), "--out", str(tmp_path / "new" / "pictures")]
    assert main(words) == (130 if isinstance(stop, KeyboardInterrupt) else 2)
    assert list((tmp_path / "new").iterdir()) == []
    said = capsys.readouterr().err
    assert isinstance(stop, KeyboardInterrupt) or ("(No space left on device)" in said and said.count("out:") == 1)
    monkeypatch.undo()
    assert main(words) == 0
    assert len(list((tmp_path / "new" / "pictures" / "right").iterdir())) == COUNT


def test_replay_says_what_is_wrong_with_the_recording(recorded, tmp_path, capsys, monkeypatch):
    """And not that its own folder cannot be written."""

    def damaged(*_):
        raise SourceFailed("recording", "must be undamaged", "frame 1")

    monkeypatch.setattr("endosdk.io.pictures.write_picture", damaged)
    assert main(["replay", str(recorded), "--out", str(tmp_path / "pictures")]) == 2
    assert "recording: must be undamaged; got frame 1 [SOURCE_FAILED]" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_recording_keeps_the_whole_rig(video, tmp_path):
    rig = replace(RIG, left_field_of_view=(48.0, 31.0, 40.0, 30.5))
    record(endosdk.open_source(video), estimator(rig), tmp_path / "r", most=1)
    kept = Recording(tmp_path / "r").calibration
    assert kept == rig
    assert kept.sha256 == rig.sha256


def test_nothing_is_added_after_the_end(video, tmp_path):
    source = endosdk.open_source(video)
    frame = next(iter(source))
    result = estimator().predict(frame.left, frame.right)
    with Recorder(tmp_path / "r", estimator(), source) as recorder:
        recorder.add(frame, result)
        recorder.close()
        with pytest.raises(InvalidArgument, match="recorder: must not have ended"):
            recorder.add(frame, result)
    with Recorder(tmp_path / "r", estimator(), source) as again, pytest.raises(InvalidArgument, match="recorder"):
        again.add(frame, result)
    with Recorder(tmp_path / "empty", estimator(), source) as nothing:
        nothing.close()
        with pytest.raises(InvalidArgument, match="recorder"):
            nothing.add(frame, result)
    assert Recording(tmp_path / "r").count == 1


def test_another_setting_of_a_recording_that_was_begun_is_named(recorded, video, tmp_path):
    source = endosdk.open_source(video)
    said = "out: must be new, or a recording of the same source, .*, begun with"
    with pytest.raises(InvalidArgument, match=f"{said} pictures true, not false "):
        Recorder(recorded, estimator(), source, pictures=False)
    with pytest.raises(InvalidArgument, match=rf"{said} calibration \{{.*\.\.\., not null "):
        Recorder(recorded, estimator(None), source)
    with pytest.raises(InvalidArgument, match=rf'{said} source ".*v\.mkv", not "nothing" '):
        Recorder(recorded, estimator(), NoFrames("nothing"))


def test_two_recorders_never_share_a_folder(video, tmp_path):
    source = endosdk.open_source(video)
    frame = next(iter(source))
    with Recorder(tmp_path / "r", estimator(), source) as recorder:
        recorder.add(frame, estimator().predict(frame.left, frame.right))
        with pytest.raises(InvalidArgument, match="out: must not be in use by another process"):
            record(source, estimator(), tmp_path / "r")
    assert Recording(tmp_path / "r").count == 1


def test_a_disk_that_locks_no_folders_is_warned_of(tmp_path, monkeypatch, caplog):
    def refused(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refused)
    with locked_folder(tmp_path / "r", "out"):
        pass
    assert "this disk cannot lock folders (No locks available): nothing keeps a second process out" in caplog.text


class NoFrames(Source):
    """A source that ends before its first frame."""

    def _read(self, start):
        yield from ()


@pytest.mark.parametrize("ending", [".mkv", ".mcap"])
def test_a_source_without_frames_leaves_no_file(tmp_path, ending):
    with pytest.raises(InvalidArgument, match="source: must hold frames; got nothing"):
        record(NoFrames("nothing"), estimator(), tmp_path / f"r{ending}")
    assert list(tmp_path.iterdir()) == []


def test_a_recording_without_frames_becomes_no_file(tmp_path, capsys):
    assert record(NoFrames("nothing"), estimator(), tmp_path / "r")["frames"] == 0
    assert main(["replay", str(tmp_path / "r"), "--out", str(tmp_path / "f.mkv")]) == 2
    assert "recording: must hold frames" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["r"]


STOPPED = """
import os, pathlib, sys
import endosdk
from endosdk.live.recording import recorder, record
recorder.PART_FRAMES = 3
source = endosdk.open_source(sys.argv[1]).tagged(lambda frame: frame.number < 5 or os._exit(9))
rig = endosdk.StereoCalibration.load(sys.argv[3])
estimator = endosdk.DepthEstimator(sys.argv[4], calibration=rig, threads=1)
record.record(source, estimator, pathlib.Path(sys.argv[2]))
"""


def test_a_recording_that_was_killed_goes_on(video, tmp_path):
    RIG.save(tmp_path / "rig.json")
    out = tmp_path / "r"
    words = [sys.executable, "-c", STOPPED, str(video), str(out), str(tmp_path / "rig.json"), str(TINY_MODEL)]
    assert subprocess.run(words, check=False).returncode == 9
    begun = Recording(out)
    assert begun.count == 3  # the part that was whole
    assert np.array_equal(next(iter(begun)).left, PAIRS[0][0])
    record(endosdk.open_source(video), estimator(), out)
    check(out)


KILLED_IN_THE_END = """
import os, pathlib, shutil, sys
import endosdk
from endosdk.live.recording import recorder, record
recorder.PART_FRAMES = 2
save, remove = recorder.Recorder._save, shutil.rmtree

def killed_before_it_is_complete(recorder):
    if recorder.complete:
        os._exit(9)
    save(recorder)

def killed_after_one_part(path, **options):
    remove(min(path.iterdir()) if path.name == "parts" else path, **options)
    if path.name == "parts":
        os._exit(9)

when, video, out, rig, model, most = sys.argv[1:]
if when == "before it is complete":
    recorder.Recorder._save = killed_before_it_is_complete
else:
    shutil.rmtree = killed_after_one_part
estimator = endosdk.DepthEstimator(model, calibration=endosdk.StereoCalibration.load(rig), threads=1)
record.record(endosdk.open_source(video), estimator, pathlib.Path(out), most=int(most))
"""


def killed_in_the_end(when, video, out, most):
    RIG.save(out.with_name("rig.json"))
    words = [when, str(video), str(out), str(out.with_name("rig.json")), str(TINY_MODEL), str(most)]
    assert subprocess.run([sys.executable, "-c", KILLED_IN_THE_END, *words], check=False).returncode == 9


def test_a_recording_whose_parts_are_not_all_removed_is_whole(video, tmp_path):
    out = tmp_path / "r"
    killed_in_the_end("after one part", video, out, COUNT)
    assert len(list((out / "parts").iterdir())) == COUNT // 2 - 1
    check(out)
    assert main(["replay", str(out), "--out", str(tmp_path / "f.mkv")]) == 0
    check(tmp_path / "f.mkv")
    record(endosdk.open_source(video), estimator(), out, most=COUNT)
    assert not (out / "parts").exists()
    check(out)


def test_a_recording_that_is_joined_and_not_complete_goes_on(video, tmp_path):
    out = tmp_path / "r"
    killed_in_the_end("before it is complete", video, out, 3)
    assert [frame.number for frame in Recording(out)] == [0, 1, 2]
    record(endosdk.open_source(video), estimator(), out)
    check(out)


def test_a_recording_can_be_swapped_and_tagged_like_every_source(recorded):
    for queue in ("every", "newest"):
        frames = list(endosdk.open_source(recorded, swap=True, queue=queue).tagged(lambda frame: frame.number))
        assert np.array_equal(frames[-1].left, PAIRS[-1][1])
        assert np.array_equal(frames[-1].right, PAIRS[-1][0])
        assert frames[-1].tag == COUNT - 1


def interrupted_at_picture(monkeypatch, number):
    """Let control-C come while a picture of a recording is written."""
    add, count = VideoWriter.add, iter(range(1000))

    def interrupted(self, picture, stamp_ns):
        if next(count) == number:
            signal.raise_signal(signal.SIGINT)
        add(self, picture, stamp_ns)

    monkeypatch.setattr(VideoWriter, "add", interrupted)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_while_a_frame_is_written_loses_nothing_of_it(video, tmp_path, monkeypatch):
    interrupted_at_picture(monkeypatch, 7)  # of three a frame
    with pytest.raises(KeyboardInterrupt):
        record(endosdk.open_source(video), estimator(), tmp_path / "r")
    assert [frame.number for frame in Recording(tmp_path / "r")] == [0, 1, 2]
    assert not list((tmp_path / "r").glob(".partial-*"))
    record(endosdk.open_source(video), estimator(), tmp_path / "r")
    check(tmp_path / "r")


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("name", ["r", "r.mkv"])
def test_an_interrupt_ends_the_recording_of_a_pipe(tmp_path, monkeypatch, name):
    interrupted_at_picture(monkeypatch, 7)
    source = piped(PAIRS)
    summary = record(source, estimator(), tmp_path / name)
    assert summary["frames"] == 3
    assert [frame.number for frame in Recording(tmp_path / name)] == [0, 1, 2]
    assert Recording(tmp_path / name).lines[2]["number"] == 2
    assert [path.name for path in tmp_path.iterdir()] == [name]
    if name == "r":
        assert (tmp_path / "r" / "preview.mp4").is_file()
        with pytest.raises(InvalidArgument, match="a camera or a pipe cannot be continued"):
            record(piped(PAIRS), estimator(), tmp_path / "r")


def piped(pairs):
    """A pipe of Y4M."""
    pipe = io.BytesIO()
    write(pipe, side_by_side(pairs), "wrapped_avframe", "yuv444p", container="yuv4mpegpipe")
    return Piped(io.BytesIO(pipe.getvalue()), SourceOptions())


HEEDING = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from endosdk.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""


# The files of a part grow in steps of many frames: what is recorded is not seen from outside.
TELLING = f"""
import sys
from pathlib import Path
from endosdk.live.recording.recorder import Recorder
add, told = Recorder.add, Path(sys.argv.pop(1))
def telling(recorder, frame, result):
    add(recorder, frame, result)
    with told.open("a") as file: file.write(str(frame.number))
Recorder.add = telling
{HEEDING}
"""


def running(words, program=HEEDING):
    """A command that hears control-C wherever these tests were begun."""
    return subprocess.Popen(
        [sys.executable, "-c", program, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_silent_pipe_can_be_ended_by_a_signal(tmp_path, number):
    out, told = tmp_path / "r", tmp_path / "told"
    words = ["run", "-", "--raw", "rgb24:192x64", "--model", str(TINY_MODEL), "--threads", "1", "--out", str(out)]
    with running([str(told), *words], TELLING) as command:
        try:
            command.stdin.write(b"".join(np.hstack(pair).tobytes() for pair in PAIRS))
            command.stdin.flush()
            deadline = time.monotonic() + 60
            while not told.exists() or told.read_text() != "01234567":
                assert command.poll() is None and time.monotonic() < deadline
                time.sleep(0.05)
            command.send_signal(number)
            assert command.wait(timeout=60) == 0, command.stderr.read().decode()
        finally:
            command.kill()
        assert all(b": no frame for" in line for line in command.stderr.read().splitlines())
        frames = list(endosdk.open_source(out))
        assert f"frames     {COUNT}: " in command.stdout.read().decode()
    assert [frame.number for frame in frames] == list(range(COUNT))
    assert np.array_equal(frames[0].left, PAIRS[0][0])
    assert (out / "preview.mp4").is_file()


def test_a_pipe_that_falls_silent_is_told_of_while_it_is(tmp_path):
    """`endosdk run` waits for it, and what was recorded is whole once it goes on."""
    words = ["run", "-", "--raw", "rgb24:192x64", "--model", str(TINY_MODEL), "--out", str(tmp_path / "r")]
    with running(words) as command:
        try:
            command.stdin.write(np.hstack(PAIRS[0]).tobytes())
            command.stdin.flush()
            assert command.stderr.readline() == b"standard input: no frame for 2 s\n"
            command.stdin.write(np.hstack(PAIRS[1]).tobytes())
            command.stdin.close()
            assert command.wait(timeout=60) == 0
            assert b"frames     2: " in command.stdout.read()
        finally:
            command.kill()


@pytest.mark.parametrize(("once", "told"), [(True, ["no frame for 0 s", "no frame for 1 s"]), (False, [])])
def test_a_file_that_is_slow_is_not_silent(monkeypatch, once, told):
    class Slow(Source):
        def _read(self, start):
            yield Frame(*PAIRS[0], 0, 0)
            deadline = time.monotonic() + (60 if once else 1.2)
            while len(self.faults) < 2 and time.monotonic() < deadline:
                time.sleep(0.01)
            yield Frame(*PAIRS[1], 1, 1)

    monkeypatch.setattr("endosdk.live.silence.FIRST_S", 0.4)
    source = Slow("slow")
    source.once = once
    with told_of_silence(source, source.frames()) as frames:
        assert [frame.number for frame in frames] == [0, 1]
    assert source.faults == told
    for thread in threading.enumerate():
        if thread.name == "endosdk-silence":
            thread.join(5)  # it looks ten times a second
            assert not thread.is_alive()


@pytest.mark.parametrize("raw", [(), ("--raw", "rgb24:192x64")])
def test_a_pipe_without_a_frame_can_be_interrupted(tmp_path, raw):
    with running(["run", "-", *raw, "--model", str(TINY_MODEL), "--out", str(tmp_path / "r")]) as command:
        try:
            command.stdin.write(b"YUV4MPEG2 ")
            command.stdin.flush()
            deadline = time.monotonic() + 60
            while struct.unpack("i", fcntl.ioctl(command.stdin, termios.FIONREAD, bytes(4))) != (0,):
                assert command.poll() is None and time.monotonic() < deadline
                time.sleep(0.05)
            command.send_signal(signal.SIGINT)
            assert command.wait(timeout=60) == 130
        finally:
            command.kill()
        assert command.stderr.read() == b"endosdk run: interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_what_was_written(video, tmp_path):
    # The limit of the operating system on a file's size stands for the disk.
    RIG.save(tmp_path / "rig.json")
    full = "__import__('resource').setrlimit(__import__('resource').RLIMIT_FSIZE, (2000, 2000))"
    program = STOPPED.replace("os._exit(9)", full)
    out = tmp_path / "r"
    words = [sys.executable, "-c", program, str(video), str(out), str(tmp_path / "rig.json"), str(TINY_MODEL)]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert "StorageFailed" in done.stderr.splitlines()[-1]
    assert [frame.number for frame in Recording(out)] == [0, 1, 2]
    assert not list(out.glob(".partial-*"))
    record(endosdk.open_source(video), estimator(), out)
    check(out)


@pytest.fixture(params=["full in a part", "full in the end"])
def small_disk(tmp_path, request):
    """A small file system, and what makes it larger: the parts do not fit, or they do and the joined files do not."""
    folder = tmp_path / "disk"
    folder.mkdir()
    size = {"full in a part": "128k", "full in the end": "260k"}[request.param]
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("only root may mount a file system: run the tests as root")

    def grow():
        subprocess.run(["mount", "-o", "remount,size=8m", str(folder)], check=True)

    yield folder, grow
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_disk_that_is_full_for_real_keeps_whole_parts(video, small_disk, monkeypatch, capsys):
    folder, grow = small_disk
    monkeypatch.setattr("endosdk.live.recording.recorder.PART_FRAMES", 2)
    RIG.save(folder / "rig.json")
    words = ["run", str(video), "--model", str(TINY_MODEL), "--calibration", str(folder / "rig.json")]
    assert main([*words, "--out", str(folder / "r")]) == 2
    told = capsys.readouterr().err
    assert "No space left on device" in told
    assert "Traceback" not in told
    kept = [frame.number for frame in Recording(folder / "r")]
    assert kept == list(range(len(kept)))
    assert 2 <= len(kept) <= COUNT
    grow()
    assert main([*words, "--out", str(folder / "r")]) == 0
    check(folder / "r")


@pytest.mark.parametrize("small_disk", ["full in a part"], indirect=True)
def test_a_full_disk_ends_the_recording_and_not_the_view(video, small_disk, monkeypatch):
    folder, _ = small_disk
    monkeypatch.setattr("endosdk.live.recording.recorder.PART_FRAMES", 2)
    player = Player(estimator(), endosdk.open_source(video), playing=False)
    player.record(folder / "r")
    player.start()
    player.play()
    deadline = time.monotonic() + 30
    while not player.ended:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert player.latest.frame.number == COUNT - 1
    assert player.recording is None
    assert "No space left" in str(player.error)
    player.close()
    assert len(list(Recording(folder / "r"))) >= 2


def test_other_settings_are_refused(recorded, video):
    with pytest.raises(InvalidArgument, match="same source, model, rig and limits"):
        record(endosdk.open_source(video), estimator(None), recorded)


def test_the_same_source_read_in_another_way_is_another_one(video, tmp_path, capsys):
    words = ["run", str(video), "--model", str(TINY_MODEL), "--out", str(tmp_path / "r")]
    main([*words, "--swap", "--frames", "2"])
    assert np.array_equal(next(iter(Recording(tmp_path / "r"))).left, PAIRS[0][1])
    assert main([*words, "--frames", "2"]) == 2
    assert "same source, model, rig and limits" in capsys.readouterr().err


def test_what_is_done_is_not_done_again(recorded, video):
    before = (recorded / "depth.mkv").stat().st_mtime_ns
    assert record(endosdk.open_source(video), estimator(), recorded)["frames"] == COUNT
    assert (recorded / "depth.mkv").stat().st_mtime_ns == before


def test_a_recording_that_frames_ended_is_not_taken_for_more(video, tmp_path, capsys):
    words = ["run", str(video), "--model", str(TINY_MODEL), "--out", str(tmp_path / "r")]
    for few in ("0", "-3"):
        assert main([*words, "--frames", few]) == 2
        assert "frames: must be at least 1" in capsys.readouterr().err
    assert main(["run", str(video), "--model", str(TINY_MODEL), "--out", str(tmp_path / "whole"), "--frames", "8"]) == 0
    assert main(["run", str(video), "--model", str(TINY_MODEL), "--out", str(tmp_path / "whole")]) == 0
    for _ in range(2):
        assert main([*words, "--frames", "3"]) == 0
    assert main([*words, "--frames", "5"]) == 2
    assert "out: must be new: it was ended after 3 frames" in capsys.readouterr().err


def test_results_of_a_streamed_source_know_their_frames(video):
    source = endosdk.open_source(video).tagged(lambda frame: f"frame {frame.number}")
    results = list(estimator().stream(source))
    assert [result.source_frame.tag for result in results] == [f"frame {n}" for n in range(COUNT)]
    for result, (left, right) in zip(results, PAIRS, strict=True):
        assert np.array_equal(result.source_frame.left, left)
        assert np.array_equal(result.disparity, estimator().predict(left, right).disparity)
    assert next(iter(estimator().stream(iter(PAIRS)))).source_frame is None


def test_what_is_no_recording_is_refused_by_name(video, tmp_path, capsys):
    for path in (video, str(video)):
        with pytest.raises(InvalidArgument, match=r"^source: must be a folder or a \.mkv file that endosdk run wrote"):
            Recording(path)
    run = ["run", str(video), "--model", str(TINY_MODEL), "--frames", "2", "--out", str(tmp_path / "r.mcap")]
    main(run)
    assert main(["replay", str(tmp_path / "r.mcap"), "--out", str(tmp_path / "pictures"), "--json"]) == 2
    assert "must be a folder or a .mkv file that endosdk run wrote" in capsys.readouterr().err


def test_run_writes_a_ros_2_bag_under_its_own_name(video, tmp_path):
    out = tmp_path / "r.ros2"
    assert main(["run", str(video), "--model", str(TINY_MODEL), "--out", str(out)]) in (0, 1)
    assert sorted(path.name for path in out.iterdir()) == ["metadata.yaml", "r.ros2.db3"]
    assert "partial" not in (out / "metadata.yaml").read_text()
    assert endosdk.open_source(out).count == COUNT


def test_without_pictures_and_rig(video, tmp_path):
    record(endosdk.open_source(video), estimator(None), tmp_path / "r", pictures=False, most=3)
    recording = Recording(tmp_path / "r")
    assert recording.settings["map"]["name"] == "disparity"
    (_, disparity) = next(recording.maps())
    wanted = estimator(None).predict(*PAIRS[0])
    assert np.nanmax(np.abs(disparity - np.where(wanted.reasons == 0, wanted.disparity, np.nan))) <= 1 / 128 + 1e-6
    with pytest.raises(SourceFailed, match="recorded without them"):
        next(iter(recording))


@pytest.mark.parametrize("ending", [".mcap", ".bag", ".ros2"])
def test_bags_hold_the_messages_of_ros(recorded, tmp_path, ending):
    out = tmp_path / f"b{ending}"
    assert main(["replay", str(recorded), "--out", str(out)]) == 0
    found = {}
    with AnyReader([out], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    assert {topic: len(each) for topic, each in found.items()} == dict.fromkeys(found, COUNT)
    _, depth = next(Recording(recorded).maps())
    stamp, image = found["/stereo/depth"][0]
    assert stamp == 0
    assert image.encoding == "32FC1"
    metres = np.asarray(image.data).view(np.float32).reshape(64, 96)
    assert np.allclose(metres, depth / 1000, equal_nan=True)
    disparity = found["/stereo/disparity"][0][1]
    f, t = disparity.f, getattr(disparity, "t", None) or disparity.T
    values = np.asarray(disparity.image.data).view(np.float32).reshape(64, 96)
    assert np.allclose(f * t / values, metres, equal_nan=True)
    points = np.asarray(found["/stereo/points"][0][1].data).view(np.float32).reshape(-1, 3)
    assert len(points) == np.isfinite(metres).sum()
    assert points[:, 2] == pytest.approx(metres[np.isfinite(metres)])
    camera = found["/stereo/right/camera_info"][0][1]
    projection = camera.p if hasattr(camera, "p") else camera.P
    assert projection[3] == pytest.approx(-120 * 0.005)
    assert json.loads(found["/stereo/result"][2][1].data)["number"] == 2


@pytest.mark.parametrize("ending", [".mcap", ".bag", ".ros2"])
def test_bags_are_sources(recorded, tmp_path, ending):
    out = tmp_path / f"b{ending}"
    main(["replay", str(recorded), "--out", str(out)])
    source = endosdk.open_source(out)
    assert source.count == COUNT
    frames = list(source)
    assert len(frames) == COUNT
    for frame, (left, right) in zip(frames, PAIRS, strict=True):
        assert np.array_equal(frame.left, left)
        assert np.array_equal(frame.right, right)
    assert math.isclose(frames[3].stamp_ns, 160_000_000)


def bag_of(recorded, folder, keeps):
    """Write a bag of those pictures of a recording for which ``keeps`` a side, and the number on that side."""
    whole, out = folder / "whole.mcap", folder / "part"
    main(["replay", str(recorded), "--out", str(whole)])
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([whole], default_typestore=store) as reader, Writer(out, version=9) as writer:
        views = [each for each in reader.connections if each.topic.endswith("image_raw")]
        to = {each.topic: writer.add_connection(each.topic, each.msgtype, typestore=store) for each in views}
        seen = {"left": 0, "right": 0}
        for connection, stamp, data in reader.messages(views):
            side = "left" if "left" in connection.topic else "right"
            if keeps(side, seen[side]):
                writer.write(to[connection.topic], stamp, data)
            seen[side] += 1
    return endosdk.open_source(out)


def test_numbers_go_on_over_a_picture_that_a_bag_lost(recorded, tmp_path):
    source = bag_of(recorded, tmp_path, lambda side, number: side == "left" or number != 1)
    for _ in range(2):
        assert [frame.number for frame in source] == [number for number in range(COUNT) if number != 1]
        assert source.dropped == 1


def test_a_camera_of_a_bag_may_start_later_and_end_earlier(recorded, tmp_path, monkeypatch):
    monkeypatch.setattr("endosdk.live.sources.bag.MOST_WAITING", 2)
    source = bag_of(recorded, tmp_path, lambda side, number: side == "left" or 4 <= number < COUNT - 1)
    assert [frame.number for frame in source] == list(range(4, COUNT - 1))
    assert [sum("left picture" in fault for fault in source.faults), source.fault_count] == [5, 5]


def test_a_bag_without_a_pair_is_refused(recorded, tmp_path):
    source = bag_of(recorded, tmp_path, lambda side, number: (side == "left") == (number < 3))
    with pytest.raises(SourceFailed, match="must hold pictures of one time"):
        list(source)


def test_compressed_pictures_of_16_bits_are_refused():
    packed = cv2.imencode(".png", np.full((8, 8), 900, np.uint16))[1].tobytes()
    message = SimpleNamespace(format="mono16; png compressed", data=packed)
    with pytest.raises(InvalidArgument, match="8 bits a channel; got 16 bits"):
        picture_of(message, "/left")


def test_a_recording_that_goes_on_keeps_its_size(tmp_path):
    model = DepthEstimator(str(TINY_MODEL), threads=1)
    for side, pictures in (("left", 0), ("right", 1)):
        (tmp_path / side).mkdir()
        for number in range(4):
            height = 64 if number < 2 else 80
            cv2.imwrite(str(tmp_path / side / f"{number}.png"), shifted_pair(height, 96, 4)[pictures])
    # The first run ends where the size changes, the second would begin there.
    for rule in ("must have the size of the stream", "must keep its size"):
        with pytest.raises(InvalidArgument, match=rule):
            record(endosdk.open_source(f"{tmp_path / 'left'},{tmp_path / 'right'}"), model, tmp_path / "r")
    assert [frame.left.shape[0] for frame in Recording(tmp_path / "r")] == [64, 64]


def test_a_bag_may_hold_two_connections_to_a_topic(recorded, tmp_path):
    """As when a driver was started again."""
    main(["replay", str(recorded), "--out", str(tmp_path / "whole.bag")])
    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader1(tmp_path / "whole.bag") as reader, Writer1(tmp_path / "two.bag") as writer:
        views = [each for each in reader.connections if each.topic.endswith("image_raw")]
        to = {
            (each.topic, part): writer.add_connection(
                each.topic, each.msgtype, typestore=store, callerid=f"/driver{part}"
            )
            for each in views
            for part in range(2)
        }
        for number, (connection, stamp, data) in enumerate(reader.messages(views)):
            writer.write(to[connection.topic, number // COUNT], stamp, data)
    source = endosdk.open_source(tmp_path / "two.bag")
    assert source.count == COUNT
    assert [frame.number for frame in source] == list(range(COUNT))


def test_a_damaged_recording_is_refused(recorded, tmp_path):
    (tmp_path / "recording.json").write_text("{")
    with pytest.raises(SourceFailed, match="whole recording"):
        endosdk.open_source(tmp_path)
    (tmp_path / "x.mcap").write_bytes(b"no bag")
    with pytest.raises(SourceFailed, match="bag that can be read"):
        endosdk.open_source(tmp_path / "x.mcap")


@pytest.mark.parametrize("name", ["pair.mkv", "depth.mkv", "frames.jsonl"])
def test_a_changed_recording_is_never_replayed_as_if_it_were_the_one_that_was_made(recorded, tmp_path, name):
    """Files are changed at twenty places each: what comes back is what was recorded, or an error."""
    copy = tmp_path / "r"
    shutil.copytree(recorded, copy)
    content = (recorded / name).read_bytes()
    wanted, refused = contents_of(recorded), 0
    for place in np.linspace(len(content) // 10, len(content) - 1, 20).astype(int):
        changed = bytearray(content)
        changed[place] ^= 4
        (copy / name).write_bytes(changed)
        try:
            found = contents_of(copy)
        except SourceFailed:
            refused += 1
            continue
        assert found == wanted, f"{name}, byte {place}"  # such as the name of the program that wrote the file
    assert refused >= 15


def contents_of(path):
    """All that a recording gives back, as bytes."""
    frames = [(f.number, f.stamp_ns, f.left.tobytes(), f.right.tobytes()) for f in endosdk.open_source(path)]
    return frames, [(line, values.tobytes()) for line, values in Recording(path).maps()]


def test_a_recording_of_one_file_is_known_by_its_hashes_too(recorded, tmp_path):
    file = tmp_path / "r.mkv"
    assert main(["replay", str(recorded), "--out", str(file)]) == 0
    content = bytearray(file.read_bytes())
    place = content.rindex(b'"valid_share": 0.') + 17  # a digit of a line
    content[place] = ord("0") + (content[place] - ord("0") + 1) % 10
    file.write_bytes(content)
    with pytest.raises(SourceFailed, match="must have the lines that it was recorded with"):
        endosdk.open_source(file)


def test_replay_refuses_names_that_cannot_be(recorded, tmp_path, capsys):
    (tmp_path / "file").touch()  # the privileged may write every folder; a file can hold none
    assert main(["replay", str(recorded), "--out", str(tmp_path / "file" / "pictures")]) == 2
    assert "file (File exists)" in capsys.readouterr().err
    assert main(["replay", "x" * 300, "--out", str(tmp_path / "pictures")]) == 2
    assert "must be a folder or a .mkv file that endosdk run wrote" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["depth.mp4", "depth.AVI", "depth.webm"])
def test_a_name_of_a_video_is_no_folder(tmp_path, name):
    with pytest.raises(InvalidArgument, match=r"out: must be a folder, or end in one of \.mkv"):
        check_out(tmp_path / name)
