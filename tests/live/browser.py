"""Headless Chromium, driven through its debugging protocol."""

from __future__ import annotations

import asyncio
import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

START_S = 60


class Browser:
    """One page of a headless Chromium."""

    def __init__(self, folder: Path, width: int = 1400, height: int = 1000) -> None:
        program = shutil.which("chromium") or shutil.which("google-chrome")
        if program is None:
            pytest.skip("no Chromium (Debian: apt-get install chromium)")
        self._log = folder / "chromium.log"
        options = [
            "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--mute-audio",
            "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
            "--remote-debugging-port=0", f"--user-data-dir={folder / 'profile'}", f"--window-size={width},{height}",
            "about:blank",
        ]  # fmt: skip
        environment = {**os.environ, "HOME": str(folder)}
        with self._log.open("wb") as log:
            self._process = subprocess.Popen([program, *options], stdout=log, stderr=log, env=environment)
        self._port_file = folder / "profile" / "DevToolsActivePort"
        self._loop = asyncio.new_event_loop()
        self._next = 0
        self.complaints: list[str] = []  # what the page's console said
        self._session, self._socket = self._loop.run_until_complete(self._connect())
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    async def _connect(self) -> tuple[Any, Any]:
        import aiohttp

        deadline = time.monotonic() + START_S
        while not (self._port_file.exists() and self._port_file.read_text().strip()):
            assert time.monotonic() < deadline, self._log.read_text()
            await asyncio.sleep(0.1)
        port = self._port_file.read_text().split()[0]
        session = aiohttp.ClientSession()
        async with session.get(f"http://127.0.0.1:{port}/json") as answer:
            page = next(tab for tab in await answer.json() if tab["type"] == "page")
        return session, await session.ws_connect(page["webSocketDebuggerUrl"], max_msg_size=0)

    def call(self, method: str, **parameters: Any) -> Any:
        return self._loop.run_until_complete(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> Any:
        self._next += 1
        await self._socket.send_str(json.dumps({"id": self._next, "method": method, "params": parameters}))
        while True:
            reply = json.loads((await asyncio.wait_for(self._socket.receive(), START_S)).data)
            if reply.get("id") == self._next:
                assert "error" not in reply, reply
                return reply["result"]
            if reply.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
                self.complaints.append(json.dumps(reply["params"]))

    def open(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.wait(f"location.href.startsWith({address!r}) && document.readyState === 'complete'")

    def run(self, script: str) -> Any:
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script: str, seconds: float = 30) -> Any:
        """Wait until a script gives something true; return it."""
        deadline = time.monotonic() + seconds
        while not (found := self.run(script)):
            assert time.monotonic() < deadline, (script, self.complaints)
            time.sleep(0.1)
        return found

    def click(self, x: float, y: float, count: int = 1) -> None:
        for n in range(1, count + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=n)

    def drag(self, x: float, y: float, dx: float, dy: float) -> None:
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + dx, y=y + dy, button="left", buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + dx, y=y + dy, button="left", clickCount=1)

    def screenshot(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self) -> None:
        self._loop.run_until_complete(self._socket.close())
        self._loop.run_until_complete(self._session.close())
        self._loop.close()
        self._process.terminate()
        self._process.wait(20)
