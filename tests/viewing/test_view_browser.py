"""A real browser opens a page: it comes up, shows the views of its records, and asks no other address for anything.

The browser is driven by the DevTools protocol; without a graphics card Chromium draws by SwiftShader.
"""
import asyncio
import base64
import contextlib
import io
import json
import shutil
import subprocess
import time
import urllib.request

import numpy as np
import pytest
from PIL import Image
from synthetic_fan import fan
from synthetic_sidescan import sidescan

import mitsonar

pytest.importorskip("rerun", reason="rerun-sdk is not installed")
websocket = pytest.importorskip("tornado.websocket", reason="tornado, of the extra cluster, is not installed")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-headless-shell", "chromium-browser",
                                               "google-chrome"))), None)
pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="there is no chromium here")]
OPTIONS = ("--headless", "--no-sandbox", "--remote-debugging-port=0", "--use-angle=swiftshader",
           "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--window-size=1200,800")
STATE = "Array.from(viewer.viewer_state(), (byte) => String.fromCharCode(byte)).join('')"
LONGEST = 90.0                     # [s] until the page is up


class Tab:
    """A tab of the browser, and the requests and messages of its page."""

    def __init__(self, connection):
        self._connection, self._number, self.events = connection, 0, []

    async def ask(self, method, **parameters):
        """Return the answer to a command; other messages are kept."""
        self._number += 1
        await self._connection.write_message(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(await asyncio.wait_for(self._connection.read_message(), LONGEST))
            if message.get("id") == self._number:
                return message.get("result", message)
            self.events.append(message)

    async def value(self, expression):
        """Return the value of an expression in the page."""
        return (await self.ask("Runtime.evaluate", expression=expression))["result"].get("value")


@contextlib.contextmanager
def browser(folder):
    """Start a browser; yield the address of a tab."""
    assert BROWSER is not None
    child = subprocess.Popen([BROWSER, *OPTIONS, f"--user-data-dir={folder}", "about:blank"],
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port, until = folder / "DevToolsActivePort", time.monotonic() + LONGEST
        while not (port.exists() and port.read_text().strip()):
            assert child.poll() is None and time.monotonic() < until, "the browser does not start"
            time.sleep(0.1)
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(f"http://127.0.0.1:{port.read_text().split()[0]}/json/list") as answer:
            yield next(tab["webSocketDebuggerUrl"] for tab in json.load(answer) if tab["type"] == "page")
    finally:
        child.terminate()
        child.wait()


async def visit(address, page):
    """Open a page; return the viewer's state, a screenshot and the requests that were made or refused."""
    tab = Tab(await websocket.websocket_connect(address, max_message_size=1 << 28))
    for domain in ("Network", "Page"):
        await tab.ask(f"{domain}.enable")
    await tab.ask("Page.navigate", url=page)
    until, state = time.monotonic() + LONGEST, ""
    while time.monotonic() < until and "/world" not in state:
        await asyncio.sleep(0.5)
        state = await tab.value(STATE) or "" if await tab.value("window.started") else ""
    await asyncio.sleep(3)                                         # until pictures are on the graphics card
    shot = base64.b64decode((await tab.ask("Page.captureScreenshot"))["data"])
    requests = [event["params"]["request"]["url"] for event in tab.events
                if event.get("method") == "Network.requestWillBeSent"]
    return state, np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")), requests


def test_the_page_comes_up_shows_its_records_and_asks_nobody_else(tmp_path):
    page = mitsonar.view(fan(pings=2), sidescan(pings=40, bins=60))
    assert page is not None
    try:
        with browser(tmp_path) as address:
            state, shot, requests = asyncio.run(visit(address, page.url))
    finally:
        page.close()
    assert [name for name in ("/fan/fan", "/sidescan/waterfall", "/world") if name not in state] == []
    assert "time" in state and "ping" in state                     # the time lines
    assert len(np.unique(shot.reshape(-1, 3), axis=0)) > 500       # speckle in colours, not an empty page
    own = {url.removeprefix(page.url) for url in requests if url.startswith(page.url)}
    assert own >= {"", "re_viewer.js", "re_viewer_bg.wasm", "run.rrd"}
    assert not [url for url in requests if not url.startswith((page.url, "data:", "blob:"))]
