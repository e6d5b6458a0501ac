"""Page of a recording in the browser, served on this machine alone.

The page is rerun's viewer, as it comes with the SDK, beside a recording in a file. Its own page would fetch fonts, ask
for newer versions and report its use. Here the header Content-Security-Policy keeps the browser from any other
address, the server listens at 127.0.0.1, and its addresses begin with a word that is drawn anew for every page.
"""
from __future__ import annotations

import functools
import http.server
import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
import webbrowser
from pathlib import Path

HERE = "127.0.0.1"
VIEWER = ("re_viewer.js", "re_viewer_bg.wasm")          # the parts of rerun's viewer
RECORDING, INDEX = "run.rrd", "index.html"
POLICY = "default-src 'self' blob: data: 'unsafe-inline' 'wasm-unsafe-eval'"
STARTS_IN = 30.0                   # [s]: rerun's own server
HEIGHT = 720                       # pixels of the page in a notebook
HTML = """<!doctype html>
<html><head><meta charset="utf-8"><title>mitsonar: %(title)s</title><link rel="icon" href="data:,">
<style>html, body, canvas { margin: 0; width: 100%%; height: 100%%; overflow: hidden; background: #0d1011; color: #ddd;
font-family: sans-serif } p { position: absolute; left: 2em; top: 2em }</style></head>
<body><canvas id="canvas"></canvas><p id="words">Loading the viewer ...</p>
<script src="re_viewer.js"></script>
<script>
  const words = document.getElementById("words");
  wasm_bindgen({ module_or_path: "re_viewer_bg.wasm" }).then(() => {
    window.viewer = new wasm_bindgen.WebHandle({
      url: [new URL("run.rrd", location).href], hide_welcome_screen: true, enable_history: false, persist: false,
      theme: "dark" });
    return window.viewer.start(document.getElementById("canvas"));
  }).then(() => { words.remove(); window.started = true; })
    .catch((error) => { words.textContent = "The viewer does not start; it needs WebGL 2 and WebAssembly: " + error; });
</script></body></html>
"""


class ViewerPage:
    """Page that is served until it is closed; notebooks show it.

    Attributes
    ----------
    url : str
        Address of the page on this machine.
    """

    def __init__(self, folder: Path, title: str, port: int = 0) -> None:
        """Serve a folder that holds the recording; it is removed with the page."""
        self._folder = folder
        for name in _viewer()[1]:
            os.symlink(name, folder / name.name)
        (folder / INDEX).write_text(HTML % {"title": title}, encoding="utf-8")
        word = secrets.token_urlsafe(9)
        try:
            self._server = _Server((HERE, port), functools.partial(
                _Handler, directory=str(folder), word=word))
        except (OSError, OverflowError) as error:
            raise ValueError(f"the port {port} cannot be served ({error}); give another one, or 0 for any.") from None
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.url = f"http://{HERE}:{self._server.server_port}/{word}/"

    def open(self) -> None:
        """Open the page in the user's browser, if there is one."""
        webbrowser.open(self.url)

    def wait(self) -> None:
        """Serve the page until Ctrl-C, then close it."""
        try:
            while self._thread.is_alive():
                self._thread.join(0.2)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """End the server and remove its files; a second call does nothing."""
        self._server.shutdown()
        self._server.server_close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _repr_html_(self) -> str:
        """Return the page as a frame in a notebook whose kernel runs on the same machine as the browser."""
        return f'<iframe src="{self.url}" width="100%" height="{HEIGHT}" style="border: 0"></iframe>'


class _Server(http.server.ThreadingHTTPServer):
    """Server that says nothing of browsers that go away."""

    def handle_error(self, request, client_address) -> None:
        """Report what is not an end of the connection."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Handler(http.server.SimpleHTTPRequestHandler):
    """Requests for files of a folder below a secret word, of this machine alone."""

    protocol_version = "HTTP/1.1"
    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".wasm": "application/wasm",
                      ".rrd": "application/octet-stream"}

    def __init__(self, *args, directory: str, word: str) -> None:
        self._word = word
        super().__init__(*args, directory=directory)

    def send_head(self):
        """Refuse other hosts, which names of other machines may lead here, and other addresses."""
        host, path = self.headers.get("Host", "").rpartition(":")[0], self.path.partition("?")[0]
        name = path.removeprefix(f"/{self._word}/")
        if host not in (HERE, "localhost") or name == path or name not in ("", INDEX, RECORDING, *VIEWER):
            self.send_error(404)
            return None
        self.path = f"/{name}"
        return super().send_head()

    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cache-Control", "no-store")
        super().end_headers()

    def log_message(self, *_) -> None:
        """Say nothing of requests."""


@functools.cache
def _viewer() -> tuple[tempfile.TemporaryDirectory[str], list[Path]]:
    """Return the files of rerun's viewer, which its own server hands out once, and their folder while it is kept."""
    import rerun_cli  # pyright: ignore[reportMissingImports]  # comes with rerun-sdk

    kept = tempfile.TemporaryDirectory(prefix="mitsonar_viewer_")
    folder = Path(kept.name)
    with socket.create_server((HERE, 0)) as free:
        port = free.getsockname()[1]
    program = Path(str(rerun_cli.__file__)).with_name("rerun")
    # CI keeps the program from reporting its use; a recording's address, from a server that would take data
    child = subprocess.Popen([program, "--serve-web", "--bind", HERE, "--web-viewer-port", str(port),
                              f"http://{HERE}:{port}/none.rrd"], env={**os.environ, "CI": "1"},
                             stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for name in VIEWER:
            _fetch(f"http://{HERE}:{port}/{name}", folder / name, child)
    finally:
        child.terminate()
        child.wait()
    return kept, [folder / name for name in VIEWER]


def _fetch(address: str, path: Path, child: subprocess.Popen) -> None:
    """Write what a server that may still be starting sends."""
    direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    until = time.monotonic() + STARTS_IN
    while True:
        try:
            with direct.open(address, timeout=STARTS_IN) as answer, open(path, "wb") as file:
                shutil.copyfileobj(answer, file)
            return
        except urllib.error.URLError as error:
            if child.poll() is not None or time.monotonic() > until:
                raise ValueError(f"rerun's viewer does not start ({error.reason}); install rerun-sdk again, or use "
                                 "--save and open the file by rerun itself.") from None
            time.sleep(0.05)

