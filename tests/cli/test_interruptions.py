"""Real processes that are interrupted, or lose their disk or their listener: what they say, leave, and end with.

The child sets a trap in one place of mitsonar and runs the command; the trap springs when the command gets there. So
every moment is hit exactly, however fast the machine.
"""
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_scene import spoilt

ROOT = Path(__file__).resolve().parents[2]
RENDER = ("render", "scene.xml", "-o", "o.exr", "--preview", "p.png")
CAST = ('<float name="sound_speed" value="1500"/>', '<string name="cast" value="c.csv"/>')

CHILD = """
import os, signal, sys

def trap(owner, name, spring):
    meant = getattr(owner, name)
    def sprung(*arguments, **options):
        spring()
        return meant(*arguments, **options)
    setattr(owner, name, sprung)

def kill():
    os.kill(os.getpid(), signal.{signal})

{trap}
from mitsonar.__main__ import main
sys.exit(main(sys.argv[1:]))
"""
MOMENTS = {
    "during an import": """
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "mitsuba.config":
            kill()
sys.meta_path.insert(0, Finder())""",
    "within a plugin": "from mitsonar.io import casts; trap(casts, 'read', kill)",
    "during the render": "from mitsonar.cli import progress; trap(progress.Progress, '__call__', kill)",
    "before the file is complete": "from mitsonar.io import exr; trap(exr, '_config', kill)",
}


def run(folder, arguments=RENDER, *, trap="", number="SIGINT", **options):
    command = [sys.executable, "-c", CHILD.format(trap=trap, signal=number), *arguments]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen(command, cwd=folder, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, **options)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "scene.xml").write_text(spoilt(CAST), encoding="utf-8")
    (tmp_path / "c.csv").write_text("depth,speed\n0,1500\n40,1490\n", encoding="utf-8")
    return tmp_path


def left(folder):
    return sorted(path.name for path in folder.iterdir() if path.name not in ("scene.xml", "c.csv"))


@pytest.mark.parametrize("number, moment", [*(("SIGINT", moment) for moment in MOMENTS), ("SIGTERM", "within a plugin"),
                                            ("SIGTERM", "before the file is complete")])
def test_interrupted(folder, number, moment):
    child = run(folder, trap=MOMENTS[moment], number=number)
    out, err = child.communicate(timeout=120)
    assert err == "mitsonar: interrupted; no unfinished file is left\n"
    assert (child.returncode, out) == (128 + getattr(signal, number), "")
    assert left(folder) == []


def test_interrupted_long_render(folder):
    (folder / "scene.xml").write_text(spoilt(('<integer name="pings" value="$pings"/>', """
        <integer name="pings" value="500000"/> <float name="speed_knots" value="0"/>""")), encoding="utf-8")
    child = run(folder)
    time.sleep(2)
    child.send_signal(signal.SIGINT)
    try:
        out, err = child.communicate(timeout=120)
    finally:
        child.kill()                               # should it go on, it would for hours
    assert (child.returncode, out, err) == (130, "", "mitsonar: interrupted; no unfinished file is left\n")
    assert left(folder) == []


def test_interrupt_that_is_swallowed(folder):
    """Somebody's ``except BaseException`` eats the first interrupt; the next block of pings ends the render."""
    child = run(folder, trap="""
def spring():
    try:
        kill()
    except BaseException:
        pass
from mitsonar.survey.energy import energy; trap(energy, "gathered", spring)""")
    out, err = child.communicate(timeout=120)
    assert (child.returncode, out, err) == (130, "", "mitsonar: interrupted; no unfinished file is left\n")
    assert left(folder) == []


def test_full_disk(folder):
    full = "import resource; trap(exr, 'replacing', lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)))"
    child = run(folder, trap=f"from mitsonar.io import exr; {full}")
    out, err = child.communicate(timeout=120)
    assert (child.returncode, out) == (2, "")
    assert err.startswith("mitsonar: cannot write o.exr: the file grew past the largest size allowed here; free some")
    assert err.count("\n") == 1
    assert left(folder) == []


def test_nobody_listens(folder):
    child = run(folder)
    child.stdout.close()
    assert (child.stderr.read(), child.wait(timeout=120)) == ("", 0)
    assert left(folder) == ["o.exr", "p.png"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs the device /dev/full")
def test_output_cannot_be_printed(folder):
    with open("/dev/full", "w", encoding="utf-8") as full:
        child = run(folder, stdout=full)
        assert (child.communicate(timeout=120)[1], child.returncode) == ("", 0)
    assert left(folder) == ["o.exr", "p.png"]
