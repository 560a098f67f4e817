"""The page of ``endosdk view``: who may have it, and what it shows and measures, in a real browser."""

from __future__ import annotations

import asyncio
import gc
import io
import json
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import aiohttp
import numpy as np
import pytest

import endosdk
from endosdk import DepthEstimator, StereoCalibration
from endosdk.datasets.dataset import read_disparity
from endosdk.errors import InvalidArgument
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Frame
from endosdk.live.recording.recorder import Recorder
from endosdk.live.recording.recording import Recording
from endosdk.live.sources.source import Source, SourceOptions
from endosdk.live.sources.video_input import Piped
from endosdk.live.viewer import Player, Server
from endosdk.live.viewer.message import encoded
from endosdk.live.viewer.player import Shown
from tests.conftest import ROOT, TINY_MODEL
from tests.hardening.targets import VIEWS, small_result
from tests.live.browser import Browser
from tests.live.videos import side_by_side, views, write

DEMO = ROOT / "examples" / "data"
PAIRS = views(6, 64, 96)


@pytest.fixture
def served(tmp_path):
    """A small video on a page that nobody has opened yet."""
    rig = StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(96, 64))
    estimator = DepthEstimator(str(TINY_MODEL), calibration=rig, threads=1)
    player = Player(estimator, endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(PAIRS))))
    server = Server(player, recordings=tmp_path)
    yield server, player
    server.close()
    player.close()


def fetched(address, **headers):
    with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10) as answer:
        return answer.status, dict(answer.headers), answer.read()


def refused(address, **headers):
    with pytest.raises(urllib.error.HTTPError) as error:
        fetched(address, **headers)
    with error.value as answer:
        return answer.code


def test_only_who_knows_the_token_gets_the_page(served):
    server, _ = served
    status, headers, page = fetched(server.address)
    assert status == 200
    assert b"endosdk view" in page
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    host = server.address.split("/")[2]
    assert refused(f"http://{host}/") == 404
    assert refused(f"http://{host}/wrong/") == 404
    assert refused(server.address + "../player.py") == 404
    assert refused(server.address + "player.py") == 404
    assert refused(server.address, Host="evil.example") == 404
    assert refused(server.address + "live", Origin="http://evil.example") == 403


def test_it_listens_on_the_loopback_address_alone(served):
    server, _ = served
    port = int(server.address.split(":")[2].split("/")[0])
    assert bound_to(port, "tcp") == ["0100007F"]
    assert bound_to(port, "tcp6") == []


def bound_to(port, kind):
    """Addresses on which somebody listens at this port, in the hexadecimal digits of the system."""
    if not Path(f"/proc/net/{kind}").exists():  # a system without IPv6 has no table of it
        return []
    with open(f"/proc/net/{kind}") as table:  # noqa: PTH123 - no file
        rows = [line.split() for line in table.readlines()[1:]]
    return [row[1].split(":")[0] for row in rows if int(row[1].split(":")[1], 16) == port and row[3] == "0A"]


@pytest.mark.parametrize("port", ["-1", "65536", "taken"])
def test_a_port_that_cannot_be_had_is_refused(port, tmp_path):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS))
    with socket.create_server(("127.0.0.1", 0)) as other:
        asked = other.getsockname()[1] if port == "taken" else int(port)
        words = [sys.executable, "-m", "endosdk", "view", str(video), "--model", str(TINY_MODEL), f"--port={asked}"]
        done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    rule = "must be free on the loopback address" if port == "taken" else "must be 0 to 65535"
    assert done.stderr.startswith(f"endosdk view: port: {rule}; got {asked}") and done.stderr.count("\n") == 1


def test_the_page_asks_nothing_of_others():
    folder = ROOT / "python" / "endosdk" / "live" / "viewer" / "page"
    files = list(folder.iterdir())
    assert "index.html" in {path.name for path in files}
    for path in files:
        assert "http://" not in path.read_text().replace("ws://", "")
        assert "https://" not in path.read_text()


def until(true, seconds=20):
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_the_player_pauses_steps_restarts_and_records(tmp_path):
    estimator = DepthEstimator(str(TINY_MODEL), threads=1)
    source = endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(PAIRS)))
    player = Player(estimator, source, playing=False)
    player.start()
    time.sleep(0.1)
    assert player.latest is None
    player.step()
    until(lambda: player.latest is not None)
    player.step()
    until(lambda: player.latest.frame.number == 1)
    player.record(tmp_path / "r")
    player.play()
    until(lambda: player.ended)
    assert player.latest.frame.number == 5
    turn = player.latest.turn
    player.restart()  # ends the recording: its time cannot run backwards
    until(lambda: player.ended and player.latest.turn == turn + 6)
    assert player.recording is None
    assert recorded_numbers(tmp_path / "r") == [2, 3, 4, 5]
    player.record(tmp_path / "again")  # has no frame yet, so that a restart does not end it
    player.restart()
    until(lambda: player.ended and player.latest.turn == turn + 12)
    player.close()
    assert recorded_numbers(tmp_path / "again") == [0, 1, 2, 3, 4, 5]


class Camera(Source):
    """A live source that counts what is drawn of it. ``away`` lets it stand still after two frames."""

    live = True
    clock = "wall"

    def __init__(self, away=None):
        super().__init__("camera")
        self.drawn = 0
        self._away = away

    def _read(self, start):
        for number in range(1000):
            if number == 2 and self._away is not None:
                self._away.wait(20)
            self.drawn += 1
            yield Frame(*PAIRS[number % len(PAIRS)], number, time.time_ns())


def test_a_paused_camera_is_not_drawn_from_until_it_is_stepped():
    source = Camera()
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), source, playing=False)
    player.start()
    time.sleep(0.2)
    assert source.drawn == 0
    for steps in (1, 2):
        player.step()
        until(lambda turn=steps: player.latest is not None and player.latest.turn == turn)
        time.sleep(0.1)
        assert source.drawn == steps
    player.close()


def test_a_pause_before_the_time_of_a_frame_holds_it_and_a_step_shows_it(tmp_path):
    pictures = side_by_side(PAIRS)[:2]
    source = endosdk.open_source(write(tmp_path / "v.mkv", pictures, stamps=[0, 25]))
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), source)
    player.start()
    until(lambda: player.latest is not None)
    player.pause()
    time.sleep(1.3)
    assert player.latest.frame.number == 0
    player.step()
    until(lambda: player.latest.frame.number == 1)
    player.close()


def test_the_page_is_told_that_a_source_stands_still():
    away = threading.Event()
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), Camera(away))
    server = Server(player)
    player.start()
    until(lambda: player.latest is not None and player.latest.frame.number == 1)
    assert server._state()["silent_s"] == 0
    until(lambda: server._state()["silent_s"] >= 2)
    player.pause()
    assert server._state()["silent_s"] == 0
    away.set()
    server.close()
    player.close()


def test_a_recording_that_the_page_ends_early_does_not_claim_the_whole_source(tmp_path):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS))
    estimator = DepthEstimator(str(TINY_MODEL), threads=1)
    player = Player(estimator, endosdk.open_source(video), playing=False)
    player.start()
    player.record(tmp_path / "part")
    player.step()
    until(lambda: player._recorder.begun)
    player.record(tmp_path / "rest")  # which ends the one before
    player.play()
    until(lambda: player.ended)
    player.record(tmp_path / "whole")
    player.restart()
    until(lambda: player._recorder.begun and player.ended)
    player.record(tmp_path / "closed")
    player.restart()
    player.pause()
    player.step()
    until(lambda: player._recorder.begun)
    player.close()
    said = {out: (tmp_path / out / "recording.json").read_text() for out in ("part", "rest", "whole", "closed")}
    ended = {out: json.loads(record)["source_ended"] for out, record in said.items()}
    assert ended == {"part": False, "rest": False, "whole": True, "closed": False}


def test_a_pipe_cannot_begin_again_and_goes_on(tmp_path):
    raw = b"".join(picture.tobytes() for picture in side_by_side(PAIRS))
    height, width = side_by_side(PAIRS)[0].shape[:2]
    source = Piped(io.BytesIO(raw), SourceOptions(raw=f"rgb24:{width}x{height}"))
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), source, playing=False)
    player.start()
    player.step()
    until(lambda: player.latest is not None)
    with pytest.raises(InvalidArgument, match="restart: must be of a source that can be read again"):
        player.restart()
    player.play()
    until(lambda: player.ended)
    assert player.latest.frame.number == 5 and player.error is None
    player.close()


def recorded_numbers(out):
    return [frame.number for frame in Recording(out)]


def test_what_was_in_work_before_a_restart_is_not_recorded_after_it(tmp_path):
    showing, going_on = threading.Event(), threading.Event()

    def slow(shown):
        if shown.frame.number == 3:
            showing.set()
            going_on.wait(20)

    player = Player(
        DepthEstimator(str(TINY_MODEL), threads=1),
        endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(PAIRS))),
    )
    player.listeners.append(slow)
    player.start()
    assert showing.wait(20)
    player.restart()
    player.record(tmp_path / "r")
    going_on.set()
    until(lambda: player.ended and player.latest.frame.number == 5 and player.latest.turn > 6)
    player.close()
    assert recorded_numbers(tmp_path / "r") == [0, 1, 2, 3, 4, 5]


def test_a_restart_that_succeeds_clears_the_error(tmp_path):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS))
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), endosdk.open_source(video))
    away = video.rename(tmp_path / "away.mkv")
    player.start()
    until(lambda: player.ended)
    assert "v.mkv" in str(player.error)
    away.rename(video)
    player.restart()
    until(lambda: player.ended and player.latest is not None and player.latest.frame.number == 5)
    assert player.error is None
    player.close()


def test_the_page_is_told_of_any_error_of_a_listener(served):
    server, player = served
    player.listeners.append(lambda shown: 1 // 0)
    player.start()
    until(lambda: player.ended)
    assert server._state()["error"] == "ZeroDivisionError: integer division or modulo by zero"
    player.listeners.clear()
    player.restart()
    until(lambda: player.ended and player.latest.frame.number == 5)
    assert server._state()["error"] is None


TAGGED = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from endosdk.commands import view
from endosdk.commands.cli import main
opened = view.opened_source
view.opened_source = lambda args: opened(args).tagged(lambda frame: 1 // 0)
sys.exit(main(sys.argv[1:]))
"""


def test_the_page_and_the_exit_status_tell_of_any_error_of_a_tagger(tmp_path):
    words = ["view", str(write(tmp_path / "v.mkv", side_by_side(PAIRS))), "--model", str(TINY_MODEL)]
    words = [sys.executable, "-c", TAGGED, *words]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command:
        try:
            address = command.stdout.readline().split()[1]
            told = asyncio.run(asyncio.wait_for(told_of_an_error(address), 60))
            time.sleep(1)  # the command looks twice a second
            command.send_signal(signal.SIGINT)
            assert command.wait(timeout=60) == 1
        finally:
            command.kill()
        said = command.stderr.read()
    assert told == "ZeroDivisionError: integer division or modulo by zero"
    assert said.endswith(f"endosdk view: {told}\n")
    assert "Traceback" in said


async def told_of_an_error(address):
    """Open the page's socket, which starts the player, and return the first error of it."""
    origin = "/".join(address.split("/")[:3])
    async with (
        aiohttp.ClientSession(headers={"Origin": origin}) as session,
        session.ws_connect(address + "live") as socket,
    ):
        while True:
            state = (await socket.receive_json()).get("state", {})
            if state.get("error"):
                return state["error"]


async def seen_by_a_page(address, leaves):
    """Open the page's socket, ask for a measurement of the first picture, and leave when told to or turned out."""
    origin = "/".join(address.split("/")[:3])
    async with (
        aiohttp.ClientSession(headers={"Origin": origin}) as session,
        session.ws_connect(address + "live") as socket,
    ):
        async for message in socket:
            if message.type == aiohttp.WSMsgType.BINARY:
                await socket.send_str("drawn")
                await socket.send_str('{"do": "measure", "kind": "point", "pixels": [[48, 32]], "id": 1}')
                await asyncio.to_thread(leaves.wait, 20)
                socket._response.connection.transport.abort()
                return True
    return False


def told_by_the_server(caplog):
    return [record for record in caplog.records if record.name in ("aiohttp.server", "asyncio")]


@pytest.mark.parametrize("sent", ["measurement", "picture"])
def test_a_page_that_closes_while_something_is_on_its_way_is_no_error(served, monkeypatch, caplog, sent):
    server, _ = served
    leaves, sends = threading.Event(), threading.Event()

    def slow(shown, *words):
        leaves.set()
        assert sends.wait(20)
        return {} if sent == "measurement" else encode(shown, *words)

    encode = server._encode
    if sent == "measurement":
        monkeypatch.setattr("endosdk.live.viewer.server.measured", slow)
    else:
        pictures = iter([encode])
        monkeypatch.setattr(server, "_encode", lambda *words: next(pictures, slow)(*words))
    assert asyncio.run(asyncio.wait_for(seen_by_a_page(server.address, leaves), 60))
    time.sleep(0.2)  # the server has heard of it
    sends.set()
    time.sleep(0.5)
    gc.collect()  # a task whose error nobody has asked for says so when it goes
    assert leaves.is_set() and told_by_the_server(caplog) == []


def test_an_error_of_what_is_sent_is_told_and_closes_the_page(served, monkeypatch, caplog):
    server, _ = served
    monkeypatch.setattr(server, "_encode", lambda *_: 1 // 0)
    assert not asyncio.run(asyncio.wait_for(seen_by_a_page(server.address, threading.Event()), 20))
    until(lambda: told_by_the_server(caplog))
    assert told_by_the_server(caplog)[0].exc_info[0] is ZeroDivisionError


def test_a_file_for_rerun_needs_a_rig(tmp_path):
    video = write(tmp_path / "v.mkv", side_by_side(PAIRS))
    words = [sys.executable, "-m", "endosdk", "view", str(video), "--model", str(TINY_MODEL)]
    words += ["--rerun", str(tmp_path / "v.rrd"), "--json"]
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert json.loads(done.stdout)["error"]["code"] == "CALIBRATION_REQUIRED"
    assert "rerun: needs --calibration" in done.stderr
    assert not (tmp_path / "v.rrd").exists()


def test_a_recording_that_ends_while_an_answer_is_added_has_it(tmp_path, monkeypatch):
    adding, going_on = threading.Event(), threading.Event()
    add = Recorder.add

    def slow_add(recorder, frame, result):
        adding.set()
        going_on.wait(5)
        add(recorder, frame, result)

    monkeypatch.setattr(Recorder, "add", slow_add)
    source = endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(PAIRS)))
    player = Player(DepthEstimator(str(TINY_MODEL), threads=1), source, playing=False)
    player.record(tmp_path / "r")
    player.start()
    player.step()
    assert adding.wait(20)
    ending = threading.Thread(target=player.record, args=(None,))
    ending.start()
    time.sleep(0.2)
    going_on.set()
    ending.join()
    player.step()
    until(lambda: player.latest.frame.number == 1)
    player.close()
    assert player.error is None
    assert [line["number"] for line in Recording(tmp_path / "r").lines] == [0]
    assert not [path for path in (tmp_path / "r").iterdir() if path.is_dir()]  # no part is left


def test_the_page_is_sent_the_nearest_step():
    result = small_result()
    shown = Shown(Frame(*VIEWS, 0, 0), result, 1, 0.0, 0.0)
    message = encoded(shown, VIEWS[0], {})
    (length,) = struct.unpack_from("<I", message)
    facts = json.loads(message[4 : 4 + length])
    at = 4 + length + facts["parts"][0]
    levels = np.frombuffer(message, "<u2", facts["columns"] * facts["rows"], at).reshape(result.depth.shape)
    known = result.reasons == 0
    assert np.array_equal(levels > 0, known)
    assert np.abs(levels * facts["map"]["step"] - result.depth)[known].max() <= 0.0501  # half a step of 0.1 mm


@pytest.mark.slow
def test_a_click_measures_what_is_there(tmp_path):
    """The rendered demonstration pair as a video of three frames: depth and distance against truth, in the browser."""
    rig = StereoCalibration.load(DEMO / "rig.json")
    pair = [read_frame(DEMO / "demo" / f"{side}.png") for side in ("left", "right")]
    estimator = DepthEstimator("fast", calibration=rig)
    video = write(tmp_path / "v.mkv", side_by_side([pair] * 3))
    player = Player(estimator, endosdk.open_source(video))
    server = Server(player, recordings=tmp_path)
    browser = Browser(tmp_path)
    try:
        browser.open(server.address)
        browser.wait("document.body.dataset.turn === '3'", 120)
        browser.wait("document.getElementById('message').textContent.includes('ended')")
        _check_pictures(browser)
        _check_measurements(browser, rig)
        browser.screenshot(tmp_path / "page.png")
        assert browser.complaints == []
    finally:
        browser.close()
        server.close()
        player.close()


@pytest.mark.slow
def test_the_page_names_causes_and_plots_the_rig(tmp_path):
    rig = StereoCalibration.rectified(focal_px=120.0, baseline_mm=5.0, size=(96, 64))
    estimator = DepthEstimator(str(TINY_MODEL), calibration=rig, threads=1)
    twice = [(left, left) for left, _ in PAIRS[:2]]  # one camera on both inputs
    player = Player(estimator, endosdk.open_source(write(tmp_path / "v.mkv", side_by_side(twice))))
    server = Server(player, recordings=tmp_path)
    browser = Browser(tmp_path)
    try:
        browser.open(server.address)
        causes = browser.wait("[...document.querySelectorAll('#causes li')].map((li) => li.textContent)")
        assert any(cause.startswith("SAME_VIEW") for cause in causes)
        assert browser.run("document.getElementById('status').textContent") == "INVALID"
        assert browser.run("document.querySelectorAll('#plots canvas').length") == 5
        assert browser.complaints == []
    finally:
        browser.close()
        server.close()
        player.close()


def _check_pictures(browser):
    """The left view, the map and the cloud are pictures of something; turning the cloud changes it."""
    spread = """(id) => { const c = document.getElementById(id); const k = document.createElement('canvas');
        k.width = c.width; k.height = c.height; const x = k.getContext('2d'); x.drawImage(c, 0, 0);
        const d = x.getImageData(0, 0, k.width, k.height).data; let s = 0, q = 0, n = d.length / 4;
        for (let i = 0; i < d.length; i += 4) { s += d[i + 1]; q += d[i + 1] ** 2; }
        return Math.sqrt(q / n - (s / n) ** 2); }"""
    for name in ("left", "map", "cloud", "scale"):
        assert browser.run(f"({spread})('{name}')") > 8, name
    box = middle_of(browser, "cloud")
    before = browser.run("document.getElementById('cloud').toDataURL()")
    browser.drag(*box, 60, 30)
    assert browser.run("document.getElementById('cloud').toDataURL()") != before


def middle_of(browser, name):
    browser.run(f"document.getElementById('{name}').scrollIntoView({{block: 'center'}})")
    return browser.run(
        f"(() => {{ const r = document.getElementById('{name}').getBoundingClientRect();"
        "return [r.left + r.width / 2, r.top + r.height / 2] })()"
    )


def _check_measurements(browser, rig):
    g = rig.rectification()
    depth = g.focal_px * g.baseline_mm / (read_disparity(DEMO / "demo" / "disparity.png") + g.doffs)

    def point(x, y):
        z = depth[y, x]
        return np.array([(x - g.cx) / g.focal_px * z, (y - g.cy) / g.focal_y_px * z, z])

    browser.run("document.getElementById('marks').scrollIntoView({block: 'center'})")
    left, top, width = browser.run(
        "(() => { const r = document.getElementById('marks').getBoundingClientRect();"
        "return [r.left, r.top, r.width] })()"
    )
    scale = width / g.width

    def click(x, y, count=1):
        browser.click(left + (x + 0.5) * scale, top + (y + 0.5) * scale, count)

    click(500, 420)
    browser.run("document.querySelectorAll('.tool')[1].click()")
    click(420, 500)
    click(620, 520, 2)
    browser.wait("document.querySelectorAll('#measured li[data-values]').length === 2")
    shown = [
        json.loads(text)[0]
        for text in browser.run("[...document.querySelectorAll('#measured li')].map((li) => li.dataset.values)")
    ]
    for found, true in (
        (shown[0], depth[420, 500]),
        (shown[1], np.linalg.norm(point(420, 500) - point(620, 520))),
    ):
        assert found["unit"] == "mm"
        assert abs(found["value"] - true) < 3 * found["standard_error"] + 0.002 * true  # the click is whole pixels
        assert found["standard_error"] < 0.05 * true
    _check_an_area(browser, click, point)


def _check_an_area(browser, click, point):
    """An outline drawn on the page has the area of the true surface on its plane."""
    corners = [(500, 380), (660, 380), (660, 480), (500, 480)]
    browser.run("document.querySelectorAll('.tool')[2].click()")
    for x, y in corners[:-1]:
        click(x, y)
    click(*corners[-1], 2)
    browser.wait("document.querySelectorAll('#measured li[data-values]').length === 3")
    flat, relief = json.loads(browser.run("document.querySelectorAll('#measured li')[2].dataset.values"))
    seen = np.array([point(x, y) for y in range(380, 481, 4) for x in range(500, 661, 4)])
    seen = seen[np.isfinite(seen).all(axis=1)]
    centre = seen.mean(axis=0)
    normal = np.linalg.svd(seen - centre)[2][2]
    rays = np.array([point(x, y) / point(x, y)[2] for x, y in corners])
    outline = rays * ((normal @ centre) / (rays @ normal))[:, None]
    true = np.linalg.norm(sum(np.cross(outline[k - 1], outline[k]) for k in range(len(outline)))) / 2
    assert flat["unit"] == "mm²"
    assert abs(flat["value"] - true) < 3 * flat["standard_error"] + 0.02 * true
    assert flat["standard_error"] < 0.2 * true
    assert relief["unit"] == "mm"
    assert 0 < relief["value"] < np.ptp((seen - centre) @ normal) + 3 * relief["standard_error"]
