# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A headless Chromium for the tests of the operator's page, driven by its own protocol (Chrome DevTools) over a websocket."""

import asyncio
import base64
import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import websocket_connect

from rig_nodes.view import pdf

PROGRAM = next(filter(None, map(shutil.which, pdf.BROWSERS)), None)
NEEDED = pytest.mark.skipif(PROGRAM is None, reason="no Chromium or Chrome on the PATH (Debian: apt install chromium)")
PATIENCE = 30.0  # s
KEYS = {"Tab": 9, "Enter": 13, "Escape": 27, "ArrowUp": 38, "ArrowDown": 40}
ENTER = {"text": "\r"}


class Browser:
    """One page in a browser of its own; all calls wait for their answers."""

    def __init__(self, url: str, width: int = 1200, height: int = 1000):
        """Opens the page."""
        self._folder, self._loop = Path(tempfile.mkdtemp(prefix="rig-test-")), asyncio.new_event_loop()
        options = [f"--user-data-dir={self._folder}", f"--window-size={width},{height}", "--remote-debugging-port=0"]
        self.process = subprocess.Popen(
            [PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", *options, "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._count, self.troubles = 0, []
        self._socket = self._loop.run_until_complete(self._connect())
        for domain in ("Runtime", "Page"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self.call("Page.navigate", url=url)

    async def _connect(self):
        port = self._folder / "DevToolsActivePort"
        deadline = time.monotonic() + PATIENCE
        while not (port.exists() and port.read_text().count("\n")):
            assert time.monotonic() < deadline, "the browser did not start"
            await asyncio.sleep(0.02)
        found = await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port.read_text().split()[0]}/json")
        page = next(one for one in json.loads(found.body) if one["type"] == "page")
        return await websocket_connect(page["webSocketDebuggerUrl"], max_message_size=64_000_000)

    def call(self, method: str, **parameters):
        """Calls a method of the protocol and returns its result; exceptions of the page are kept in ``troubles``."""

        async def answer():
            self._count += 1
            await self._socket.write_message(json.dumps({"id": self._count, "method": method, "params": parameters}))
            while True:
                message = json.loads(await asyncio.wait_for(self._socket.read_message(), PATIENCE))
                if message.get("id") == self._count:
                    assert "error" not in message, message
                    return message["result"]
                if message.get("method") == "Runtime.exceptionThrown":
                    self.troubles.append(message["params"]["exceptionDetails"])

        return self._loop.run_until_complete(answer())

    def js(self, expression: str):
        """Returns the value of an expression of the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression: str, seconds: float = PATIENCE):
        """Waits until an expression of the page is true, and returns its value."""
        look = f"(() => {{ try {{ return {expression}; }} catch {{ return null; }} }})()"
        deadline = time.monotonic() + seconds
        while not (value := self.js(look)) and time.monotonic() < deadline:
            self.js("new Promise((done) => setTimeout(done, 50))")
        assert value, f"never true: {expression}; state: {self.js('document.querySelector(`header`)?.innerText')}"
        return value

    def text(self, selector: str) -> str:
        """Returns the text of an element."""
        return self.js(f"document.querySelector({json.dumps(selector)}).textContent")

    def place(self, selector: str) -> tuple[float, float]:
        """Scrolls to an element and returns its middle."""
        element = f"document.querySelector({json.dumps(selector)})"
        return tuple(
            self.js(
                f"(() => {{ const e = {element}; e.scrollIntoView({{block: 'center'}}); const b = e.getBoundingClientRect(); "
                "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
            )
        )

    def mouse(self, kind: str, x: float, y: float):
        """Moves the mouse or its left button: moved, pressed, released."""
        self.call(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind.title()}",
            x=x,
            y=y,
            button="left",
            buttons=int(kind != "released"),
            clickCount=1,
        )

    def click(self, selector: str):
        """Clicks with the mouse where an element is."""
        x, y = self.place(selector)
        for kind in ("pressed", "released"):
            self.mouse(kind, x, y)

    def drag(self, selector: str, dx: float, dy: float):
        """Drags an element by so many pixels."""
        x, y = self.place(selector)
        self.mouse("pressed", x, y)
        for part in (0.5, 1.0):
            self.mouse("moved", x + part * dx, y + part * dy)
        self.mouse("released", x + dx, y + dy)

    def key(self, key: str):
        """Presses and releases a key."""
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key,
                windowsVirtualKeyCode=KEYS[key],
                **(ENTER if key == "Enter" else {}),
            )

    def write(self, selector: str, text: str):
        """Replaces the text of a field and leaves it, as a hand does."""
        self.click(selector)
        self.js("document.activeElement.select()")
        self.call("Input.insertText", text=text)
        self.key("Enter")

    def give(self, selector: str, path: Path):
        """Chooses a file in a field for files."""
        found = self.call("Runtime.evaluate", expression=f"document.querySelector({json.dumps(selector)})")
        self.call("DOM.setFileInputFiles", files=[str(path)], objectId=found["result"]["objectId"])

    def picture(self, path: Path):
        """Writes a picture of the page, for people."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        """Ends the browser."""

        async def closed():
            self._socket.close()

        self._loop.run_until_complete(closed())
        self.process.kill()
        self.process.wait()
        self._loop.close()
        shutil.rmtree(self._folder, ignore_errors=True)
