"""What uv and pip say while they install: passed on, and their own reasons where they fail.

The certificate's error is that of a real pip, which asks a server of its own machine whose certificate nobody knows.
"""
import http.server
import ssl
import sys
import threading

import distributed
import pytest

from mitsonar.cli.setup import installer

# How uv and pip report what went wrong.
UV = """error: Failed to fetch: `https://pypi.org/simple/affine/`
  Caused by: client error (Connect)
  Caused by: dns error: failed to lookup address information"""
RETRY = ("WARNING: Retrying (Retry(total={}, connect=None)) after connection broken by "
         "'NewConnectionError(\"refused\")': /simple/affine/")
PIP = "\n".join([RETRY.format(1), RETRY.format(0), "ERROR: Could not find a version that satisfies affine (none)",
                 "ERROR: No matching distribution found for affine==3.0.1"])
CHILD = "error: subprocess-exited-with-error\n  error: command 'gcc' failed"
HASHES = "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE. If you have updated them, ..."
REASONS = {
    UV: "Failed to fetch: `https://pypi.org/simple/affine/`; client error (Connect); dns error: failed to lookup "
        "address information",
    PIP: 'NewConnectionError("refused"); Could not find a version that satisfies affine (none); No matching '
         "distribution found for affine==3.0.1",
    CHILD: "command 'gcc' failed",
    HASHES: "THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE. If you have updated them, ...",
    "": "python ended with exit code 1",
}
START = "Could not install mitsonar's packages (is there a network?): "


@pytest.mark.parametrize("said", REASONS)
def test_the_reasons_are_those_that_were_given(tmp_path, said):
    (tmp_path / "python").symlink_to(sys.executable)
    with pytest.raises(installer.SetupError) as caught:
        installer.run(str(tmp_path), print, str(tmp_path / "python"), "-c", f"print({said!r}); exit(1)")
    assert str(caught.value).startswith(START)
    assert str(caught.value).removeprefix(START).rstrip(".") == REASONS[said].rstrip(".")


def test_large_downloads_and_warnings_are_passed_on_while_they_happen(tmp_path):
    heard = []
    code = r"""
import sys
print("Collecting mitsuba==3.9.1")
print("  Downloading mitsuba-3.9.1-cp311.whl.metadata (9.1 MB)")
print("  Downloading mitsuba-3.9.1-cp311.whl (62.7 MB)", flush=True)
print("WARNING: caf\xe9", file=sys.stderr, flush=True)
sys.stdout.buffer.write(b"WARNING: \xff\n")
"""
    installer.run(str(tmp_path), heard.append, sys.executable, "-c", code)
    assert heard[0] == "Downloading mitsuba-3.9.1-cp311.whl (62.7 MB)"
    assert sorted(heard[1:]) == ["WARNING: caf\xe9", "WARNING: \ufffd"]


def test_packages_elsewhere_do_not_count(tmp_path, monkeypatch):
    heard = []
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    code = "import os; print('WARNING', 'PYTHONPATH' in os.environ)"
    installer.run(str(tmp_path), heard.append, sys.executable, "-c", code)
    assert heard == ["WARNING False"]


@pytest.mark.parametrize("line", [
    "WARNING: Location 'file:///srv/wheels' is ignored: it is neither a file nor a directory.",
    "WARNING: Url '/srv/wheels' is ignored. It is either a non-existing path or lacks a specific scheme.",
    "WARNING: Skipping page http://wheels.example/simple/ because it has no links.",
    'WARNING: The index url "wheels" seems invalid, please provide a scheme.'], ids=lambda line: line.split()[1])
def test_warnings_about_places_that_pip_looks_at_are_not_passed_on(tmp_path, line):
    heard = []
    installer.run(str(tmp_path), heard.append, sys.executable, "-c", f"print({line!r}); print('WARNING: of another')")
    assert heard == ["WARNING: of another"]


@pytest.fixture
def stranger():
    """The port of an HTTPS server with a certificate that it signed itself."""
    server = http.server.HTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler)
    context = distributed.Security.temporary().get_listen_args("scheduler")["ssl_context"]
    context.verify_mode = ssl.CERT_NONE
    server.socket = context.wrap_socket(server.socket, server_side=True)
    server.handle_error = lambda *_: None
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server.server_port
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_certificate_that_is_not_trusted_is_told(tmp_path, monkeypatch, stranger):
    pytest.importorskip("pip", reason="this environment was made by uv, which brings no pip")
    for name in ("PIP_FIND_LINKS", "PIP_NO_INDEX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_RETRIES", "0")
    with pytest.raises(installer.SetupError, match="CERTIFICATE_VERIFY_FAILED.* set PIP_CERT and SSL_CERT_FILE"):
        installer.run(str(tmp_path), print, sys.executable, "-m", "pip", "install", "--index-url",
                      f"https://127.0.0.1:{stranger}/simple", "no-such-package")
