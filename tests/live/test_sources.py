"""Every kind of source gives the frames that went into it."""

import io
import os
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

import endosdk
from endosdk import Cause, DepthEstimator, StereoCalibration
from endosdk.errors import CalibrationSizeMismatch, InvalidArgument, SourceFailed
from endosdk.io.pictures import write_picture
from endosdk.live.answers import answers
from endosdk.live.frames import Frame
from endosdk.live.sources.decoder import Decoded
from endosdk.live.sources.newest import Newest
from endosdk.live.sources.source import Source, SourceOptions
from endosdk.live.sources.v4l2 import INTERVALS, Device, Missing, simultaneous
from endosdk.live.sources.video_input import Piped
from endosdk.live.sources.views import split, ways_to_split
from tests.conftest import TINY_MODEL, noisy, shifted_pair, textured_picture
from tests.live.videos import RATE, side_by_side, views, write

PAIRS = views(5)


def check(frames: list[Frame], pairs=PAIRS, tolerance=0):
    """Frames are these pairs, in order, to so many levels."""
    assert [frame.number for frame in frames] == list(range(len(pairs)))
    for frame, (left, right) in zip(frames, pairs, strict=True):
        for got, wanted in ((frame.left, left), (frame.right, right)):
            assert got.dtype == np.uint8
            assert got.shape == wanted.shape
            assert np.abs(got.astype(int) - wanted).mean() <= tolerance


def folders(root):
    for side in (0, 1):
        (root / ("left", "right")[side]).mkdir(parents=True)
        for number, pair in enumerate(PAIRS):
            write_picture(root / ("left", "right")[side] / f"{number:03d}.png", pair[side])
    return root


def test_folders_by_one_word_or_two(tmp_path):
    root = folders(tmp_path / "pictures")
    for word in (root, f"{root / 'left'},{root / 'right'}", (root / "left", root / "right")):
        source = endosdk.open_source(word, rate=10)
        frames = list(source)
        check(frames)
        assert source.count == 5
        assert source.clock == "counted"
        assert [frame.stamp_ns for frame in frames] == [n * 100_000_000 for n in range(5)]


def test_one_folder_with_the_sides_in_the_names(tmp_path):
    root = folders(tmp_path)
    for side in ("left", "right"):
        for path in (root / side).iterdir():
            path.rename(root / f"frame{path.stem}_{side}.png")
        (root / side).rmdir()
    check(list(endosdk.open_source(root)))
    (root / "frame001_left.png").unlink()
    with pytest.raises(InvalidArgument, match=r"such as f7_left.png .*frame001_right.png without a partner"):
        endosdk.open_source(root)


def test_folders_of_16_bits(tmp_path):
    root = folders(tmp_path)
    for path in root.glob("*/*.png"):
        write_picture(path, cv2.imread(str(path))[..., ::-1].astype(np.uint16) * 257)
    check(list(endosdk.open_source(root, bits=16)))
    with pytest.raises(InvalidArgument, match="say how many of the 16 are used"):
        list(endosdk.open_source(root))


def joined_by(layout, pair, gap=0):
    """One picture of two views."""
    left, right = pair
    if layout == "rows":
        return np.stack([left, right], axis=1).reshape(-1, *left.shape[1:])
    axis = 1 if layout == "side-by-side" else 0
    shape = list(left.shape)
    shape[axis] = gap
    return np.concatenate([left, np.zeros(shape, np.uint8), right], axis=axis)


@pytest.mark.parametrize(
    ("layout", "gap"), [("side-by-side", 0), ("top-bottom", 0), ("rows", 0), ("top-bottom", 6), ("side-by-side", 4)]
)
def test_a_lossless_video_gives_the_very_pixels(tmp_path, layout, gap):
    joined = [joined_by(layout, pair, gap) for pair in PAIRS]
    source = endosdk.open_source(write(tmp_path / "v.mkv", joined), layout=layout, gap=gap)
    frames = list(source)
    check(frames)
    assert [frame.stamp_ns for frame in frames] == [n * 40_000_000 for n in range(5)]
    check(list(source))  # a file can be read again


def test_the_eyes_can_be_exchanged_in_every_source(tmp_path):
    exchanged = [(right, left) for left, right in PAIRS]
    video = write(tmp_path / "v.mkv", side_by_side(exchanged))
    for queue in ("every", "newest"):
        frames = list(endosdk.open_source(video, swap=True, queue=queue))
        assert np.array_equal(frames[-1].left, PAIRS[-1][0])
        assert np.array_equal(frames[-1].right, PAIRS[-1][1])
    root = folders(tmp_path / "pictures")
    check(list(endosdk.open_source((root / "right", root / "left"), swap=True)))


def test_rows_of_two_views_are_not_taken_for_fields(tmp_path):
    joined = [joined_by("rows", pair) for pair in PAIRS]
    path = write(tmp_path / "v.mkv", joined, "mpeg2video", "yuv422p", interlaced=True, options={"b": "8M"})
    check(list(endosdk.open_source(path, layout="rows")), tolerance=8)


@pytest.mark.parametrize(
    ("picture", "ways"),
    [
        ((128, 48), ["--layout side-by-side"]),
        ((64, 96), ["--layout top-bottom", "--layout rows"]),
        ((64, 102), ["--layout top-bottom --gap 6"]),
        ((64, 48), ["--layout side-by-side-half", "--layout top-bottom-half", "--layout rows-half"]),
        ((640, 480), []),
    ],
)
def test_the_ways_to_split_a_picture_are_found_by_its_size(picture, ways):
    assert ways_to_split(picture, (64, 48)) == ways
    for way in ways:
        options = dict(zip(("layout", "gap"), way.removeprefix("--layout ").split(" --gap "), strict=False))
        views = split(np.zeros((*picture[::-1], 3), np.uint8), options["layout"], int(options.get("gap", 0)))
        assert [view.shape for view in views] == [(48, 64, 3)] * 2


def test_a_rig_of_another_size_is_refused_with_the_layout_that_fits(tmp_path):
    rig = StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(64, 48))
    estimator = DepthEstimator(str(TINY_MODEL), calibration=rig, threads=1)
    video = write(tmp_path / "v.mkv", [np.vstack(pair) for pair in PAIRS])
    with pytest.raises(
        CalibrationSizeMismatch, match=r"frames of 32x96; try --layout top-bottom or --layout rows; got 64x48"
    ):
        list(answers(estimator, endosdk.open_source(video)))
    two = write(tmp_path / "l.mkv", [np.zeros((30, 40, 3), np.uint8)] * 2)
    with pytest.raises(CalibrationSizeMismatch) as refused:
        list(answers(estimator, endosdk.open_source((two, two))))
    assert "try" not in str(refused.value)


def test_half_width_video_is_stretched_again(tmp_path):
    def half(view):
        return cv2.resize(view, (32, 48), interpolation=cv2.INTER_AREA)

    joined = [np.hstack([half(left), half(right)]) for left, right in PAIRS]
    frames = list(endosdk.open_source(write(tmp_path / "v.mkv", joined), layout="side-by-side-half"))
    check(frames, tolerance=8)  # what the squeeze took is lost; a shift of half a pixel would be 12 levels and more


def test_two_files(tmp_path):
    left = write(tmp_path / "l.mkv", [pair[0] for pair in PAIRS])
    right = write(tmp_path / "r.mkv", [pair[1] for pair in PAIRS[:4]])
    source = endosdk.open_source((left, right))
    check(list(source), PAIRS[:4])
    assert "ends after 4 frames" in source.faults[0]


def damaged(path, number):
    """Overwrite a packet of a video, so that it cannot be decoded."""
    with av.open(str(path)) as file:
        packet = bytes([each for each in file.demux(video=0) if each.size][number])
    content = path.read_bytes()
    assert content.count(packet) == 1
    path.write_bytes(content.replace(packet, b"\xff" * len(packet)))
    return path


@pytest.mark.parametrize(
    ("ending", "codec", "pixels", "tolerance"), [("mkv", "ffv1", "bgr0", 0), ("avi", "mjpeg", "yuvj420p", 8)]
)
@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("lost", [0, 2])
def test_a_packet_that_is_lost_shifts_no_pair_of_two_files(tmp_path, ending, codec, pixels, tolerance, side, lost):
    paths = [
        write(tmp_path / f"{n}.{ending}", [pair[n] for pair in PAIRS], codec, pixels, options={"g": "1"})
        for n in range(2)
    ]
    damaged(paths[side], lost)
    source = endosdk.open_source(tuple(paths))
    frames = list(source)
    kept = [number for number in range(5) if number != lost]
    assert [frame.number for frame in frames] == kept
    assert [frame.stamp_ns for frame in frames] == [number * 40_000_000 for number in kept]
    check([replace(frame, number=n) for n, frame in enumerate(frames)], [PAIRS[n] for n in kept], tolerance)
    assert source.dropped == 1
    other = ("right", "left")[side]
    assert source.faults[-1] == f"the {other} picture of {lost * 40_000_000} ns has no partner"
    assert [frame.number for frame in source.frames(3)] == [3, 4]


def test_two_files_may_start_at_different_times(tmp_path):
    left = write(tmp_path / "l.mkv", [pair[0] for pair in PAIRS])
    right = write(tmp_path / "r.mkv", [pair[1] for pair in PAIRS], stamps=range(7, 12))
    source = endosdk.open_source((left, right))
    check(list(source))
    assert source.faults == []


def test_pictures_without_time_stamps_are_taken_in_turn(tmp_path):
    left = write(tmp_path / "l.mkv", [pair[0] for pair in PAIRS], stamps=[0, 1, 2, 4, 5])
    right = [pair[1] for pair in PAIRS]
    right = write(tmp_path / "r.h264", right, "libx264", "yuv420p", container="h264", options={"bf": "0"})
    source = endosdk.open_source((left, right))
    check(list(source), tolerance=8)
    assert source.faults == []


@pytest.mark.parametrize(
    ("ending", "codec", "pixels", "tolerance"),
    [
        ("nut", "rawvideo", "uyvy422", 4),
        ("nut", "rawvideo", "nv12", 6),
        ("mov", "v210", "yuv422p10le", 4),
        ("mp4", "libx264", "yuv420p", 8),
    ],
)
def test_pixel_formats_of_capture_cards(tmp_path, ending, codec, pixels, tolerance):
    path = write(tmp_path / f"v.{ending}", side_by_side(PAIRS), codec, pixels)
    check(list(endosdk.open_source(path)), tolerance=tolerance)


def test_gray_video_has_three_equal_channels(tmp_path):
    path = write(tmp_path / "v.mkv", side_by_side(PAIRS), "ffv1", "gray")
    frame = next(iter(endosdk.open_source(path)))
    assert np.ptp(frame.left.astype(int), axis=2).max() == 0


def test_interlaced_video_loses_its_combs(tmp_path):
    # Fields 1/50 s apart, of a picture that moves sideways: rows of one frame come from two places.
    wide = views(1, 64, 200)[0][0]
    pictures = []
    for n in range(8):
        frame = wide[:, 8 * n : 8 * n + 96].copy()
        frame[1::2] = wide[1::2, 8 * n + 4 : 8 * n + 100]
        pictures.append(np.hstack([frame, frame]))
    path = write(tmp_path / "v.mkv", pictures, "mpeg2video", "yuv420p", interlaced=True, options={"b": "4M"})

    def comb(source):
        views = [frame.left.mean(axis=2) for frame in source][2:6]
        return np.mean([np.abs(v[1:-1] - (v[:-2] + v[2:]) / 2).mean() for v in views])

    joined = comb(endosdk.open_source(path))
    as_it_came = comb(endosdk.open_source(path, scan="progressive"))
    assert joined < 0.6 * as_it_came
    assert len(list(endosdk.open_source(path))) == 8


READ_STDIN = """
import sys, endosdk
options = dict(raw=sys.argv[1]) if len(sys.argv) > 1 else {}
for frame in endosdk.open_source("-", **options):
    print(frame.number, frame.stamp_ns, frame.left.shape, int(frame.left.astype(int).sum() // 10000))
"""


@pytest.mark.parametrize("raw", [None, "uyvy422:128x48"])
def test_standard_input(raw):
    pipe = io.BytesIO()
    if raw is None:
        write(pipe, side_by_side(PAIRS), "wrapped_avframe", "yuv444p", container="yuv4mpegpipe")
    else:
        write(pipe, side_by_side(PAIRS), "rawvideo", "uyvy422", container="rawvideo")
    words = [sys.executable, "-c", READ_STDIN, *([raw] if raw else [])]
    done = subprocess.run(words, input=pipe.getvalue(), capture_output=True, check=True)
    lines = done.stdout.decode().splitlines()
    assert len(lines) == 5
    for number, (line, pair) in enumerate(zip(lines, PAIRS, strict=True)):
        assert line.startswith(f"{number} {number * 40_000_000} (48, 64, 3)")
        assert int(line.split()[-1]) == pytest.approx(
            pair[0].astype(int).sum() // 10000, rel=0.05
        )  # swscale rounds 8-bit 4:2:2 down


@pytest.mark.parametrize("raw", [None, "uyvy422:128x48"])
@pytest.mark.parametrize("cut", [0, 1, 1000])
def test_a_pipe_that_is_cut_gives_its_whole_frames_and_tells(raw, cut):
    pipe = io.BytesIO()
    if raw is None:
        write(pipe, side_by_side(PAIRS), "wrapped_avframe", "yuv444p", container="yuv4mpegpipe")
    else:
        write(pipe, side_by_side(PAIRS), "rawvideo", "uyvy422", container="rawvideo")
    content = pipe.getvalue()
    source = Piped(io.BytesIO(content[: len(content) - cut]), SourceOptions(raw=raw))
    assert len(list(source)) == (4 if cut else 5)
    assert [fault for fault in source.faults if "ends within frame 4" in fault] == source.faults[-1:]
    assert bool(source.faults) == bool(cut)


@pytest.mark.parametrize("raw", [None, "uyvy422:128x48"])
@pytest.mark.parametrize("content", [b"", b"YUV4MPEG2 W128 H48 F25:1 C444\nFRAME\nabc"])
def test_a_pipe_without_a_whole_frame_is_refused(raw, content):
    with pytest.raises(SourceFailed, match=f"the program before the pipe; got {len(content)} bytes"):
        list(Piped(io.BytesIO(content), SourceOptions(raw=raw)))


def test_a_pipe_of_another_container_is_told_what_to_send(tmp_path):
    content = write(tmp_path / "v.mkv", side_by_side(PAIRS)).read_bytes()
    with pytest.raises(SourceFailed, match=r"standard input must be Y4M \(ffmpeg -i FILE -f yuv4mpegpipe -\)"):
        Piped(io.BytesIO(content), SourceOptions())


def test_a_pipe_that_breaks_in_the_middle_tells_after_its_whole_frames():
    frame = b"FRAME\n" + bytes(3 * 128 * 48)
    pipe = io.BytesIO(b"YUV4MPEG2 W128 H48 F25:1 C444\n" + 3 * frame + 30_000 * b"x")
    frames = iter(Piped(pipe, SourceOptions()))
    assert [next(frames).number for _ in range(3)] == [0, 1, 2]
    with pytest.raises(SourceFailed, match="standard input: Invalid data"):
        next(frames)


def test_start_in_the_middle(tmp_path):
    source = endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(PAIRS)))
    frames = list(source.frames(3))
    assert [frame.number for frame in frames] == [3, 4]
    assert np.array_equal(frames[0].left, PAIRS[3][0])


def test_tags_travel_with_the_frames(tmp_path):
    source = endosdk.open_source(folders(tmp_path / "p")).tagged(lambda frame: {"pose": frame.number * 2})
    assert [frame.tag for frame in source] == [{"pose": 2 * n} for n in range(5)]


class Wall(Source):
    """Two frames by the wall clock: taken ten seconds ago, and just now."""

    clock = "wall"

    def _read(self, start):
        for number, age_s in enumerate((10.0, 0.0)):
            yield Frame(*shifted_pair(64, 96, 4), number, time.time_ns() - int(age_s * 1e9))


def test_frames_of_a_live_source_have_an_age():
    estimator = DepthEstimator(str(TINY_MODEL), threads=1, max_age_ms=5000)
    source = Wall("camera")
    source.live = True
    results = list(estimator.stream(source))
    assert [Cause.STALE in result.causes for result in results] == [True, False]
    assert 10_000 <= results[0].age_ms < 15_000 and 0 <= results[1].age_ms < 5000


def test_frames_of_a_file_have_none():
    assert {result.age_ms for result in DepthEstimator(str(TINY_MODEL), threads=1).stream(Wall("bag"))} == {None}


def test_a_video_that_is_closed_early_never_waits_for_its_decoder(tmp_path):
    """Threads that decode may have something to log while the one that closes the file holds Python's lock."""
    views = [textured_picture(360, 960, seed) for seed in range(2)]  # motion and noise: much for a decoder to do
    film = [noisy(np.roll(views[number % 2], 4 * number, axis=1), 12, number) for number in range(40)]
    path = write(tmp_path / "film.mp4", film, "libx264", "yuv420p")
    code = (
        "import sys, endosdk\n"
        "for _ in range(60):\n"
        "    with endosdk.open_source(sys.argv[1]) as source: next(iter(source))"
    )
    subprocess.run([sys.executable, "-c", code, path], check=True, timeout=60)


class Fast(Source):
    """Frames that wait for nobody."""

    live = True

    def __init__(self, stamps, error=None):
        super().__init__("fast")
        self._stamps, self._error = stamps, error
        self.all_given = threading.Event()

    def _read(self, start):
        for number, stamp in enumerate(self._stamps):
            yield Frame(*PAIRS[number % 5], number, stamp)
            time.sleep(0.002)
        self.all_given.set()
        if self._error:
            raise self._error


def test_newest_only_drops_and_counts():
    camera = Fast(range(100))
    source = Newest(camera)
    seen = []
    for frame in source:
        seen.append(frame.number)
        assert camera.all_given.wait(60)  # this reader is slower than all that the camera has
    assert seen == sorted(set(seen))
    assert seen[-1] == 99
    assert len(seen) <= 2
    assert source.dropped == 100 - len(seen)


def test_the_newest_frame_of_a_file_comes_when_it_is_due(tmp_path):
    path = write(tmp_path / "film.mkv", side_by_side(PAIRS))
    begun = time.monotonic()
    with endosdk.open_source(path, queue="newest") as source:
        assert [frame.number for frame in source] == [0, 1, 2, 3, 4]  # a reader that keeps up misses none
    assert time.monotonic() - begun >= 4 / RATE
    assert source.dropped == 0


class Stalling(Source):
    """Frames that follow each other at once, but the first reader's third comes when ``go_on`` is set."""

    live = True

    def __init__(self):
        super().__init__("stalling")
        self.go_on = threading.Event()
        self._readers = 0

    def _read(self, start):
        self._readers += 1
        first = self._readers == 1
        for number in range(100):
            if first and number == 2:
                self.go_on.wait()
            yield Frame(*PAIRS[0], number, number)
            time.sleep(0.002)


def test_a_stalled_reading_that_was_left_behind_disturbs_no_later_one(monkeypatch):
    monkeypatch.setattr("endosdk.live.sources.newest.CLOSING_PATIENCE_S", 0.01)
    stalling = Stalling()
    source = Newest(stalling)
    first = iter(source)
    next(first)
    first.close()
    second = []
    for frame in source:
        second.append(frame.number)
        stalling.go_on.set()  # the thread of the first reading goes on, and ends
    assert second[-1] == 99


def test_a_reader_is_told_what_it_alone_did_not_get():
    class Gaps(Fast):
        def _read(self, start):
            yield from (Frame(*PAIRS[0], number, number) for number in (0, 2, 3, 6) if number >= start)

    source = Gaps(())
    for start, dropped in ((0, 3), (0, 3), (3, 2), (4, 2)):
        assert list(source.frames(start))
        assert source.dropped == dropped


def test_an_error_behind_the_queue_is_raised_after_the_last_frame():
    source = Newest(Fast(range(3), SourceFailed("source", "broke", "x")))
    seen = []
    with pytest.raises(SourceFailed, match="broke"):
        for frame in source:
            seen.append(frame.number)
    assert seen[-1] == 2


def test_a_stamp_that_runs_backwards_is_counted_on_and_told(caplog):
    source = Fast([0, 40, 30, 80])
    frames = list(source)
    assert [frame.stamp_ns for frame in frames] == [0, 40, 41, 80]
    assert "not after the one before" in frames[2].fault
    assert frames[3].fault is None
    assert "frame 2" in source.faults[0]
    assert "frame 2" in caplog.text


def test_stamps_go_on_after_those_of_a_reading_before():
    source = Fast([10, 50, 90])
    assert [frame.stamp_ns for frame in source.frames(after_ns=40)] == [41, 81, 121]
    assert "began anew" in source.faults[0]


def test_stamps_before_the_start_of_a_video_are_moved_and_told():
    source = Fast([-120, -80, -40])
    assert [frame.stamp_ns for frame in source] == [0, 40, 80]
    assert source.faults == ["frame 0: time stamps begin at -120 ns; 120 ns are added"]


def test_a_picture_that_cannot_be_read_is_told_and_passed_over(tmp_path):
    root = folders(tmp_path)
    (root / "right" / "002.png").write_bytes((root / "right" / "002.png").read_bytes()[:300])
    source = endosdk.open_source(root)
    assert [frame.number for frame in source] == [0, 1, 3, 4]
    assert source.dropped == 1
    assert source.faults[0].startswith("pair 2 is lost: ") and "002.png" in source.faults[0]


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("folders", {"layout": "top-bottom"}),
        ("folders", {"scan": "interlaced"}),
        ("folders", {"gap": 4}),
        ("video", {"rate": 30.0}),
        ("two videos", {"layout": "rows"}),
        ("two videos", {"gap": 2}),
    ],
)
def test_an_option_that_means_nothing_for_the_source_is_refused(tmp_path, kind, options):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS))
    word = {"folders": folders(tmp_path / "f"), "video": video, "two videos": (video, video)}[kind]
    with pytest.raises(InvalidArgument, match=f"{next(iter(options))}: means nothing for this kind of source"):
        endosdk.open_source(word, **options)


def test_a_camera_that_was_closed_ends_and_is_not_opened_again(tmp_path):
    path = write(tmp_path / "v.mkv", side_by_side(views(20)))
    source = Fast(())
    device = Device(source, str(path), SourceOptions(), container=None)
    pictures = device.pictures()
    next(pictures)
    device.close()
    assert list(pictures) == [] and source.faults == []


def test_a_clock_that_begins_anew_goes_on(tmp_path):
    """Two recordings of one camera in one file, as a capture card writes them when it is started again."""
    options = {"container": "mpegts", "options": {"b": "4M", "g": "1"}}
    one = write(tmp_path / "one.ts", side_by_side(PAIRS), "mpeg2video", "yuv420p", **options)
    (tmp_path / "two.ts").write_bytes(2 * one.read_bytes())
    source = endosdk.open_source(tmp_path / "two.ts")
    frames = list(source)
    check(frames, PAIRS + PAIRS, tolerance=8)
    steps = np.diff([frame.stamp_ns for frame in frames])
    assert (steps > 0).all()
    assert steps[:4].tolist() == [40_000_000] * 4
    assert steps[5:].tolist() == [40_000_000] * 4
    told = [frame.number for frame in frames if frame.fault]
    assert told == [5, 6]
    assert "began anew" in frames[6].fault


def test_a_stream_with_holes_gives_what_is_whole_and_tells(tmp_path):
    options = {"container": "mpegts", "options": {"g": "4", "bf": "0"}}
    pairs = views(12, 96, 128)
    path = write(tmp_path / "v.ts", side_by_side(pairs), "libx264", "yuv420p", **options)
    content = bytearray(path.read_bytes())
    packets = len(content) // 188
    for packet in range(packets // 2, packets // 2 + packets // 10):
        content[188 * packet + 20 : 188 * packet + 150] = bytes(130)
    path.write_bytes(content)
    source = endosdk.open_source(path)
    frames = list(source)
    assert [frame.number for frame in frames] == list(range(len(frames)))
    assert len(frames) >= 10
    assert any("damage" in fault or "lost" in fault or "cut short" in fault for fault in source.faults)
    assert [frame for frame in frames if frame.fault]
    for frame in (*frames[:3], frames[-1]):
        near = pairs[round(frame.stamp_ns / 40_000_000)][0]
        assert np.abs(frame.left.astype(int) - near).mean() < 8


def test_odd_width_is_refused(tmp_path):
    path = write(tmp_path / "v.mkv", [np.hstack([left, right[:, :-1]]) for left, right in PAIRS])
    with pytest.raises(InvalidArgument, match=r"even width.*127"):
        next(iter(endosdk.open_source(path)))


def test_a_broken_video_gives_what_is_left_and_tells(tmp_path):
    path = write(tmp_path / "v.mkv", side_by_side(views(20)))
    content = bytearray(path.read_bytes())
    (tmp_path / "cut.mkv").write_bytes(content[: len(content) // 2])
    source = endosdk.open_source(tmp_path / "cut.mkv")
    frames = []
    try:
        frames.extend(source)
        message = "; ".join(source.faults)
    except SourceFailed as error:
        message = str(error)
    assert message
    frames = list(_until_error(endosdk.open_source(tmp_path / "cut.mkv")))
    assert 5 <= len(frames) < 20
    for frame, pair in list(zip(frames, views(20), strict=False))[:-1]:
        assert np.array_equal(frame.left, pair[0])


def _until_error(source):
    try:
        yield from source
    except SourceFailed:
        return


@pytest.mark.parametrize(
    ("word", "options", "message"),
    [
        ("nowhere.mp4", {}, "must be a folder with left and right"),
        ("/dev/video99", {}, "video99"),
        ("", {}, "must be a folder"),
        pytest.param("x" * 300, {}, "must be a folder", id="long name"),
        pytest.param("x" * 300, {"bits": 12}, "bits: is of picture files", id="long name with bits"),
        pytest.param("x" * 300 + ",y", {}, "two folders, two files", id="long names"),
        (("a", "b", "c"), {}, "must be a folder"),
        ("a,b", {}, "two folders, two files"),
        ("rtsp://camera/stream", {}, r"ffmpeg -i ADDRESS -f yuv4mpegpipe - \| endosdk view -"),
        ("http://a/b?c=1,2", {}, "ffmpeg -i ADDRESS"),
        ("-", {"raw": "uyvy422"}, "FORMAT:WxH"),
        ("-", {"raw": "purple:4x4"}, "FORMAT:WxH"),
        ("v.mp4", {"raw": "gray:4x4"}, "standard input"),
        ("v.mp4", {"layout": "diagonal"}, "side-by-side"),
        ("v.mp4", {"rate": 0.0}, "frames a second"),
        ("v.mp4", {"gap": -1}, "gap: must be whole pixels"),
        ("v.mp4", {"gap": 2, "layout": "rows"}, "gap: must be 0"),
        ("v.mp4", {"scan": "interlaced", "layout": "rows"}, "scan: must not be interlaced"),
        ("v.mp4", {"swap": "yes"}, "swap: must be True or False"),
        ("v.mp4", {"bits": 12}, "bits: is of picture files, so the source must be folders"),
        ("v.mp4", {"bits": 8}, "must be one of 10, 12, 16"),
    ],
)
def test_wrong_words_are_refused(word, options, message):
    with pytest.raises((InvalidArgument, SourceFailed), match=message):
        endosdk.open_source(word, **options)


def test_a_folder_that_is_shut_is_told():
    user = os.geteuid()
    with tempfile.TemporaryDirectory() as root:  # others may not look into the folder of `tmp_path`
        shut = Path(root) / "shut"
        shut.mkdir(mode=0)
        Path(root).chmod(0o711)
        with pytest.raises(InvalidArgument):
            endosdk.open_source(shut / "x")  # imports what others may not read
        if user == 0:  # the privileged may read every folder
            os.seteuid(65534)
        try:
            with pytest.raises(SourceFailed, match=r"source: must be readable; got .*shut \(Permission denied\)"):
                endosdk.open_source(shut)
        finally:
            os.seteuid(user)
            shut.chmod(0o700)


def test_what_is_no_video_is_refused(tmp_path):
    (tmp_path / "v.mp4").write_text("no video")
    with pytest.raises(SourceFailed, match=r"FFmpeg can read.*v\.mp4"):
        endosdk.open_source(tmp_path / "v.mp4")


def test_a_camera_that_comes_back_goes_on(tmp_path):
    # The interface is FFmpeg's reader of files instead of V4L2: the end of the file is the plug that is pulled.
    path = write(tmp_path / "device.mkv", side_by_side(PAIRS))
    source = Fast([])
    device = Device(source, str(path), SourceOptions(), container=None, patience_s=3.0)
    pictures = device.pictures()
    first = [next(pictures) for _ in range(5)]
    write(path, side_by_side(PAIRS))
    again = next(pictures)
    assert np.array_equal(again.picture, first[0].picture)
    assert "was away" in again.fault
    assert "is gone" in source.faults[0]
    assert "is back" in source.faults[1]
    device.close()


def test_a_camera_that_stays_away_ends_the_source(tmp_path):
    path = write(tmp_path / "device.mkv", side_by_side(PAIRS))
    device = Device(Fast([]), str(path), SourceOptions(), container=None, patience_s=0.4)
    pictures = device.pictures()
    for _ in range(5):
        next(pictures)
    path.unlink()
    with pytest.raises(SourceFailed, match="must come back within"):
        next(pictures)


def test_numbers_go_on_over_frames_that_the_driver_lost():
    missing = Missing(40)
    assert [missing.before(stamp) for stamp in (5, 46, 166, 205)] == [0, 0, 2, 0]


def test_a_camera_that_slows_down_seems_to_lose_a_few_frames_and_no_more():
    missing = Missing(40)
    fast, slow = range(0, 400, 40), range(440, 2000, 80)
    assert sum(missing.before(stamp) for stamp in fast) == 0
    assert sum(missing.before(stamp) for stamp in slow) <= INTERVALS
    assert sum(missing.before(stamp) for stamp in range(2040, 4000, 80)) == 0
    assert missing.before(3960 + 240) == 2
    slow_from_the_start = Missing(40)
    assert sum(slow_from_the_start.before(stamp) for stamp in range(0, 4000, 80)) <= 2


def test_two_cameras_are_paired_by_time():
    def at(*stamps):
        return iter([Decoded(np.zeros((2, 2, 3), np.uint8), stamp, None) for stamp in stamps])

    pairs = [(a.stamp_ns, b.stamp_ns) for a, b in simultaneous(at(0, 40, 80, 120), at(41, 83, 121), 20)]
    assert pairs == [(40, 41), (80, 83), (120, 121)]


def test_results_stand_beside_their_frames(tmp_path):
    from endosdk.live.answers import answers
    from tests.conftest import TINY_MODEL

    pairs = views(6, 64, 96)
    source = endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(pairs)))
    estimator = endosdk.DepthEstimator(str(TINY_MODEL), threads=2)
    found = list(answers(estimator, source))
    assert [frame.number for frame, _ in found] == list(range(6))
    for frame, result in found:
        assert np.array_equal(estimator.predict(frame.left, frame.right).disparity, result.disparity)


def test_pyav_has_the_parts_that_sources_use():
    assert "video4linux2,v4l2" in av.formats_available
    assert "bwdif" in av.filter.filters_available
    assert RATE == 25


def test_answers_may_be_steady_in_time():
    """One still scene with new noise in every frame: the stream's own test has the numbers."""
    rng = np.random.default_rng(0)
    left, right = shifted_pair(96, 160, 8)
    frames = [
        Frame(*(np.clip(view + rng.normal(0, 6, view.shape), 0, 255).astype(np.uint8) for view in (left, right)), n, n)
        for n in range(4)
    ]
    estimator = DepthEstimator(str(TINY_MODEL), threads=1)
    plain, steady = (
        np.stack([result.disparity for _, result in answers(estimator, frames, temporal=on)]) for on in (False, True)
    )
    assert np.diff(steady, axis=0).std() < np.diff(plain, axis=0).std()
