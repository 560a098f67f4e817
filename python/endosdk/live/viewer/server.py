"""The web server of ``endosdk view``: loopback only, and nothing without the token in the address."""

from __future__ import annotations

import asyncio
import json
import secrets
import threading
from contextlib import suppress
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any

from endosdk.errors import DependencyMissing, EndoError, InvalidArgument
from endosdk.io.extras import must_install
from endosdk.live.sources.source import log
from endosdk.live.viewer.measuring import measured
from endosdk.live.viewer.message import encoded
from endosdk.live.viewer.palette import legend
from endosdk.live.viewer.player import Player, Shown
from endosdk.live.viewer.wishes import parse_wish
from endosdk.runtime.threads import start_thread

HOST = "127.0.0.1"
LARGEST_PORT = 65535
PICTURES_PER_SECOND = 10  # that the page is sent at most: more would take time from the network
LONG_SILENCE_S = 2.0  # without a new answer: the page says so
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
# The page loads nothing from anywhere else, and no other page may frame it or learn its address.
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}


class Server:
    """Serves one `Player` on a thread of its own until `close`.

    ``address`` holds the token. Whoever does not know it, and whoever asks for another host, gets 404. ``port`` 0 takes
    any that is free. The player starts when the first page opens. ``recordings`` is the folder for what the page's
    record button writes.
    """

    def __init__(self, player: Player, *, port: int = 0, recordings: Path = Path()) -> None:
        try:
            from aiohttp import web
        except ImportError as error:
            raise DependencyMissing("view", f"the page needs aiohttp, which {must_install('live')}", error) from error
        if not 0 <= port <= LARGEST_PORT:
            raise InvalidArgument("port", f"must be 0 to {LARGEST_PORT}", port)
        self._web = web
        self._player = player
        self._recordings = recordings
        self._token = secrets.token_urlsafe(18)
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()
        self._ready = threading.Event()
        self._problem: OSError | None = None
        self._port = port
        self._thread = threading.Thread(target=self._run, name="endosdk-view", daemon=True)
        start_thread(self._thread)
        self._ready.wait()
        if self._problem is not None:
            raise InvalidArgument("port", "must be free on the loopback address", f"{port} ({self._problem})")

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self._port}/{self._token}/"

    def close(self) -> None:
        """Stop serving."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._ready.set()
            self._loop.run_until_complete(self._loop.shutdown_default_executor())
            self._loop.close()

    async def _serve(self) -> None:
        application = self._web.Application()
        application.router.add_get("/{token}/{name:.*}", self._answer)
        runner = self._web.AppRunner(application, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            site = self._web.TCPSite(runner, HOST, self._port)
            await site.start()
            self._port = runner.addresses[0][1]
            self._ready.set()
            await self._stop.wait()
        except OSError as error:
            self._problem = error
        finally:
            await runner.cleanup()

    async def _answer(self, request: Any) -> Any:
        web = self._web
        given, wanted = request.match_info["token"], self._token
        # A page of another site may know the port and may have a name of its own for this address.
        hosts = (f"{HOST}:{self._port}", f"localhost:{self._port}")
        if not secrets.compare_digest(given.encode(), wanted.encode()) or request.host not in hosts:
            raise web.HTTPNotFound
        name = request.match_info["name"] or "index.html"
        if name == "live":
            if request.headers.get("Origin") not in [f"http://{host}" for host in hosts]:
                raise web.HTTPForbidden
            return await self._talk(request)
        file = resources.files("endosdk.live.viewer") / "page" / name
        if "/" in name or Path(name).suffix not in TYPES or not file.is_file():
            raise web.HTTPNotFound
        return web.Response(body=file.read_bytes(), content_type=TYPES[Path(name).suffix], headers=HEADERS)

    async def _talk(self, request: Any) -> Any:
        """Send answers to one page as fast as it takes them, and do what it asks."""
        socket = self._web.WebSocketResponse(max_msg_size=2**16, heartbeat=20)
        await socket.prepare(request)
        await _tell(socket, {"legend": legend(), "source": self._player.source.word})
        self._player.start()
        drawn = asyncio.Event()
        drawn.set()
        talk = _Talk()
        wishes: set[asyncio.Task[None]] = set()
        sending = asyncio.create_task(self._send(socket, drawn, talk))
        stopping = asyncio.create_task(self._close_when_stopped(socket))
        sending.add_done_callback(lambda _: stopping.cancel())
        try:
            async for message in socket:
                if message.type != self._web.WSMsgType.TEXT:
                    continue
                if message.data == "drawn":
                    drawn.set()
                else:  # beside what is read: to complete a recording takes long
                    wish = asyncio.create_task(self._answer_wish(socket, message.data, talk))
                    wishes.add(wish)
                    wish.add_done_callback(wishes.discard)
        finally:
            if wishes:
                await asyncio.wait(wishes)
            sending.cancel()
            stopping.cancel()
            with suppress(asyncio.CancelledError):
                await sending  # its error, where it had one, goes to the log of the server
        return socket

    async def _answer_wish(self, socket: Any, text: str, talk: _Talk) -> None:
        """Do what the page asks for. Where that fails, the page is closed, which it can see."""
        try:
            await _tell(socket, await asyncio.to_thread(self._obey, text, talk))
        except Exception:
            log.exception("the page is closed")
            await socket.close()

    async def _close_when_stopped(self, socket: Any) -> None:
        try:
            await self._stop.wait()
        finally:  # also where sending failed: a page that gets nothing any more must not look as if it did
            await socket.close()

    async def _send(self, socket: Any, drawn: asyncio.Event, talk: _Talk) -> None:
        last = None
        while not socket.closed:
            await asyncio.sleep(1 / PICTURES_PER_SECOND)
            await drawn.wait()
            shown, state = self._player.latest, self._state()
            if shown is None or talk.shown is shown:
                if state != last:
                    await _tell(socket, {"state": state})
                    last = state
                continue
            message = await asyncio.to_thread(self._encode, shown, state)
            talk.shown, last = shown, state
            drawn.clear()
            with suppress(ConnectionError):
                await socket.send_bytes(message)

    def _encode(self, shown: Shown, state: dict[str, Any]) -> bytes:
        return encoded(shown, self._player.left_view(shown), state)

    def _state(self) -> dict[str, Any]:
        player = self._player
        recording, silent_s = player.recording, player.silent_s
        return {
            "playing": player.playing,
            "ended": player.ended,
            "error": player.problem,
            "recording": None if recording is None else str(recording),
            "silent_s": int(silent_s) if silent_s >= LONG_SILENCE_S else 0,
            "dropped": player.source.dropped,
            "faults": player.source.faults[-3:],
            "count": player.source.count,
            "again": player.source.again,
        }

    def _obey(self, text: str, talk: _Talk) -> dict[str, Any]:
        """Do what the page asks for; return the answer."""
        wish: dict[str, Any] = {}
        try:
            wish = parse_wish(text)
            match wish["do"]:
                case "measure":
                    return {"measured": measured(talk.shown, wish["kind"], wish["pixels"]), "id": wish["id"]}
                case "record":
                    name = f"recording-{datetime.now():%Y%m%d-%H%M%S}"
                    self._player.record(None if self._player.recording else self._recordings / name)
                case simple:
                    getattr(self._player, simple)()
            return {"state": self._state()}
        except EndoError as error:
            return {"refused": f"{error.argument} {error.rule}", "id": wish.get("id")}


async def _tell(socket: Any, content: dict[str, Any]) -> None:
    """Send one answer, unless the page has been closed meanwhile."""
    with suppress(ConnectionError):
        await socket.send_str(json.dumps(content))


class _Talk:
    """What one page has been shown last: measurements are of that."""

    shown: Shown | None = None
