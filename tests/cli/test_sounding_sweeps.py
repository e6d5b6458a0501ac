"""Lines of soundings by several processes and as the renders of a sweep have the bytes of one process.

A line that ended on its way goes on, in a sweep too; the sweep replaces the unfinished file of other pings.
"""
import json
import os
import signal
import subprocess
import sys
import time

import pytest
from test_soundings_go_on import SCENE

from mitsonar.cli import main as cli

# one sector, and beams twice as wide: a ping takes half as long
SIMPLE = SCENE.replace("narrow_600khz", "shallow_400khz")
PLAN = """
scene = "scene.xml"
output = "line_{depth}.nc"
seeds = [5]
[grid]
depth = [6, 7]
[soundings]
snippets = 4
"""


@pytest.fixture
def scene(folder):
    """A small line of soundings in the current folder, and a plan of two such lines."""
    (folder / "scene.xml").write_text(SIMPLE, encoding="utf-8")
    (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    return folder


def test_processes_share_a_line_and_a_dry_run_leaves_nothing(variant, scene, capfd):
    (scene / "scene.xml").write_text(SCENE, encoding="utf-8")
    line = ["soundings", "scene.xml", "--seed", "5", "--column"]
    assert cli.main([*line, "-o", "a.nc"]) == 0
    assert cli.main([*line, "-o", "b.nc", "--processes", "2"]) == 0
    assert (scene / "a.nc").read_bytes() == (scene / "b.nc").read_bytes()
    capfd.readouterr()
    before = sorted(scene.iterdir())
    assert cli.main([*line, "-o", "c.nc", "--dry-run"]) == 0
    out = capfd.readouterr().out
    assert out.startswith("3 pings: about ") and "(tried 3), by 1 process that keep" in out and "disk: about" in out
    assert sorted(scene.iterdir()) == before


def test_a_sweep_sounds_lines_goes_on_and_replaces_unfinished_files_of_other_pings(
        variant, scene, capfd, kept, interrupted):
    alone = ["soundings", "scene.xml", "--seed", "5", "--snippets", "4", "-D"]
    for depth in (6, 7):
        assert cli.main([*alone, f"depth={depth}", "-o", f"{depth}.nc"]) == 0
    (scene / "plan").mkdir()
    # a line that was killed after two pings, and one of other options; no process has so high a number
    for name, words in (("line_6.nc", ["depth=6"]), ("line_7.nc", ["depth=7", "--column"])):
        whole = [word if word != "scene.xml" else str(scene / word) for word in alone]
        interrupted(*whole, *words, "-o", f"plan/{name}")
        (scene / "plan" / f".{name[:-3]}.7fffffff-0123abcd.nc").write_bytes(b"half")
        assert (scene / f"plan/{name}.part").exists()
    capfd.readouterr()
    assert cli.main(["sweep", "plan.toml", "--processes", "1"]) == 0
    assert "2 rendered" in capfd.readouterr().out
    entries = [json.loads(text) for text in (scene / "plan/manifest.jsonl").read_text().splitlines()]
    assert [entry["output"] for entry in entries] == ["line_6.nc", "line_7.nc"] and entries[0]["instruction_set"]
    assert sorted(os.listdir("plan")) == [".sweep.lock", "line_6.nc", "line_7.nc", "manifest.jsonl"]
    for depth in (6, 7):                               # the scene's path is in the file: absolute in a sweep
        sizes = [(scene / name).stat().st_size for name in (f"{depth}.nc", f"plan/line_{depth}.nc")]
        assert abs(sizes[0] - sizes[1]) < 500
    content = {name: (scene / "plan" / name).read_bytes() for name in ("line_6.nc", "line_7.nc")}
    assert cli.main(["sweep", "plan.toml", "-o", "other", "--processes", "2"]) == 0
    assert content == {name: (scene / "other" / name).read_bytes() for name in content}
    assert cli.main(["sweep", "plan.toml"]) == 0
    assert "nothing to do" in capfd.readouterr().out
    (scene / "plan.toml").write_text(PLAN.replace("snippets = 4", "snippets = 6"), encoding="utf-8")
    assert cli.main(["sweep", "plan.toml", "--dry-run"]) == 0
    assert "2 to be rendered again" in capfd.readouterr().out


@pytest.mark.slow
def test_a_line_of_several_processes_that_is_killed_goes_on_and_its_workers_end(variant, scene):
    words = ["soundings", "scene.xml", "--processes", "2", "--threads", "2", "-o"]
    text = SIMPLE.replace('name="pings" value="3"', 'name="pings" value="20"')
    (scene / "scene.xml").write_text(text, encoding="utf-8")
    assert cli.main(["soundings", "scene.xml", "-o", "whole.nc"]) == 0
    for pings in (1, 10):
        run = subprocess.Popen([sys.executable, "-m", "mitsonar", *words, "line.nc"], stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 120
        while _written(scene / "line.nc.part") < pings and run.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        assert (scene / "line.nc.part").exists()
    assert cli.main([*words, "line.nc"]) == 0
    assert (scene / "line.nc").read_bytes() == (scene / "whole.nc").read_bytes()
    assert sorted(name for name in os.listdir(".") if "line" in name) == ["line.nc"]


def _written(path):
    """Return the number of whole pings of an unfinished file; 0 without one."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            return int(file["pings_written"][()]) if "pings_written" in file else 0
    except OSError:
        return 0
