"""The command `view`: a page that ends by Ctrl-C, a file of rerun, and one sentence about what is wrong."""
import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.device.extras import MissingExtra

pytest.importorskip("rerun", reason="rerun-sdk is not installed")


@pytest.fixture
def record(folder):
    """A sidescan's image in the current folder."""
    mitsonar.write(sidescan(pings=3, bins=20), "side.exr")
    return folder


def test_a_file_of_rerun_is_written(record, capfd):
    assert cli.main(["view", "side.exr", "--save", "run.rrd"]) == 0
    assert capfd.readouterr().out == "run.rrd\n"
    assert (record / "run.rrd").read_bytes().startswith(b"RRF2")


def test_what_is_wrong_is_said_in_one_sentence_and_leaves_no_file(record, refusal):
    (record / "notes.txt").write_text("notes")
    (record / "cut.exr").write_bytes((record / "side.exr").read_bytes()[:2000])
    (record / "empty.nc").write_bytes(b"")
    mitsonar.write(sidescan(pings=3, bins=20)["level"].astype(complex).rename("signals"), "signals.nc")
    for words, *arguments in (("must end in .rrd", "side.exr", "--save", "run.html"),
                              ("there is no such file", "none.exr"), ("notes.txt", "notes.txt"),
                              ("cut.exr", "cut.exr"), ("empty.nc", "empty.nc"), ("signals.nc", "signals.nc"),
                              ("cut.exr", "side.exr", "cut.exr", "--save", "run.rrd"),
                              ("a cell is of fans", "side.exr", "--cell", "1"),
                              ("--port", "side.exr", "--save", "run.rrd", "--port", "8000"),
                              ("port", "side.exr", "--port", "99999", "--no-browser"),
                              ("does not exist", "side.exr", "--save", "none/run.rrd")):
        assert words in refusal("view", *arguments)


def test_without_the_extra_the_user_is_told_to_install_it(record, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtra, match=r"pip install 'mitsonar\[view\]'"):
        cli.main(["view", "side.exr"])


@pytest.mark.slow
def test_the_page_is_served_on_this_machine_alone_until_ctrl_c(record):
    """Other addresses of the machine refuse; the header keeps the browser from any other; nothing is left behind."""
    temporary = record / "tmp"
    temporary.mkdir()
    child = subprocess.Popen([sys.executable, "-m", "mitsonar", "view", "side.exr", "--no-browser"],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                             env={**os.environ, "TMPDIR": str(temporary)})
    try:
        assert child.stdout is not None
        address = child.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]+/", address)
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(address, timeout=10) as page:
            policy = page.headers["Content-Security-Policy"]
            assert "default-src 'self'" in policy and "http" not in policy and b"re_viewer.js" in page.read()
        for name, start in (("re_viewer_bg.wasm", b"\0asm"), ("run.rrd", b"RRF2")):
            with direct.open(address + name, timeout=10) as file:
                assert file.read(4) == start
        for wrong in (address + "../../etc/passwd", address.rsplit("/", 2)[0] + "/", address + "none",
                      urllib.request.Request(address, headers={"Host": "example.org"})):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                direct.open(wrong, timeout=10)
        port = int(re.search(r":(\d+)/", address)[1])
        listening = [line.split()[1] for kind in ("tcp", "tcp6") for line in open(f"/proc/net/{kind}")
                     if line.split()[1].endswith(f":{port:04X}") and line.split()[3] == "0A"]
        assert listening == [f"0100007F:{port:04X}"]
        child.send_signal(signal.SIGINT)
        assert child.wait(30) == 0
    finally:
        child.kill()
        child.wait()
    assert child.stderr is not None and "Traceback" not in child.stderr.read()
    assert not list(temporary.iterdir())
