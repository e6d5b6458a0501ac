"""Pictures by several processes have the bytes of one process; an interrupted run ends them and leaves nothing."""
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from small_scene import spoilt

from mitsonar import load_file
from mitsonar.cli import main as cli
from mitsonar.io.records import exr
from mitsonar.sweep.manifest import versions
from mitsonar.sweep.pools.local import Local
from mitsonar.sweep.pools.picture_jobs import PictureParts
from mitsonar.verbs.images import rendered

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SMALL = {"pings": 3, "rays": 4000, "bins": 120, "elements": 8, "beams": 16}
# shipped scenes of every kind whose pings can be shared; that of moving swimmers has other surroundings at each ping
SHARED = {"sidescan_targets": {"pings": 33}, "forward_looking": {}, "swimmers": {"range": 8},
          "echo_sounder": {}, "interferometric": {}, "multibeam": {"preset": "shallow_400khz", "range": 30, "pings": 2},
          "sidescan_survey": {"range": 50, "rays": 2000, "pings": 33}}
SLOW = "sidescan_targets", "multibeam"
LONG = 'name="pings" value="$pings"', 'name="pings" value="5000"/> <float name="speed_knots" value="0"'


@pytest.fixture(scope="module")
def pool():
    """Two processes, started once."""
    with Local(2, 2, os.getcwd()) as processes:
        yield processes


def job(path, given):
    """Return what a process needs to plan a run."""
    return {"scene": str(path), "parameters": given, "seed": 5, "sensor": 0, "versions": versions(),
            "folder": os.getcwd()}


def check_same(path, given, pool, tmp_path):
    """Check that a picture by two processes has the bytes of that by this one, and that they computed it."""
    parts, counts = PictureParts(pool, job(path, given)), []

    def counted(work, pings):
        counts.append(len(pings))
        return parts(None, pings)

    for name, run_parts in (("one", map), ("two", counted)):
        exr.write(rendered(load_file(path, **given), 5, 0, run_parts=run_parts), tmp_path / f"{name}.exr")
    assert len(counts) == 1 and counts[0] > 1
    assert (tmp_path / "one.exr").read_bytes() == (tmp_path / "two.exr").read_bytes()


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in SHARED])
def test_processes_share_the_pings_of_every_kind(variant, pool, tmp_path, name):
    path = SCENES / f"{name}.xml"
    given = {key: value for key, value in {**SMALL, **SHARED[name]}.items()
             if f'<default name="{key}"' in path.read_text(encoding="utf-8")}
    check_same(path, given, pool, tmp_path)


@pytest.mark.slow
def test_processes_share_the_pings_of_a_picture_from_elements(variant, pool, tmp_path):
    scene = tmp_path / "elements.xml"
    scene.write_text(spoilt(("</sensor>", '<string name="picture" value="elements"/></sensor>'),
                            ('"casts/', f'"{SCENES}/casts/'),
                            text=(SCENES / "forward_looking.xml").read_text(encoding="utf-8")), encoding="utf-8")
    check_same(scene, {"pings": 2, "elements": 4, "beams": 16, "range": 12, "cell": 0.05}, pool, tmp_path)


def test_the_command_shares_pings_and_refuses_what_cannot_be_shared(variant, folder, capfd):
    for name, processes in (("a.exr", "1"), ("b.exr", "2")):
        assert cli.main(["render", "scene.xml", "-o", name, "--processes", processes]) == 0
    assert (folder / "a.exr").read_bytes() == (folder / "b.exr").read_bytes()
    capfd.readouterr()
    for words, message in ((["scene.xml", "--processes", "0"], "0 processes were asked for; give 1 to 1024"),
                           (["scene.xml", "--processes", "2", "--each-ping"], "--processes and --each-ping are both"),
                           (["sector_scan", "--processes", "2", "-D", "bins=50"],
                            "the pings of a sector_scan cannot be shared among processes")):
        assert cli.main(["render", *words, "-o", "c.exr"]) == 2
        assert message in capfd.readouterr().err
    assert not (folder / "c.exr").exists()


def test_a_killed_process_is_reported(variant, tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text(spoilt(), encoding="utf-8")
    with Local(1, 2, os.getcwd()) as pool:
        parts = PictureParts(pool, job(scene, {}))
        next(parts(None, [0]))
        process = pool._renderers[0]._process
        process.send_signal(signal.SIGSTOP)            # it takes the next job and never answers
        threading.Timer(0.5, process.kill).start()
        with pytest.raises(ValueError, match=r"ended by signal 9 \(Killed\)"):
            rendered(load_file(scene), 5, 0, run_parts=parts)


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="needs Linux's /proc to find the processes")
def test_an_interrupted_run_ends_its_processes_and_leaves_nothing(tmp_path):
    (tmp_path / "scene.xml").write_text(spoilt(LONG), encoding="utf-8")
    run = subprocess.Popen([sys.executable, "-m", "mitsonar", "render", "scene.xml", "-o", "o.exr", "--processes", "2"],
                           cwd=tmp_path, stderr=subprocess.PIPE, text=True,
                           env={**os.environ, "PYTHONPATH": str(SCENES.parent)})
    deadline, workers = time.monotonic() + 120, []
    while len(workers) < 2 and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
        workers = [int(pid) for task in Path(f"/proc/{run.pid}/task").glob("*")
                   for pid in (task / "children").read_text().split()]
    run.send_signal(signal.SIGINT)
    try:
        assert run.communicate(timeout=120)[1] == "mitsonar: interrupted; no unfinished file is left\n"
    finally:
        run.kill()
    assert run.returncode == 130 and os.listdir(tmp_path) == ["scene.xml"] and len(workers) == 2
    assert not any(os.path.exists(f"/proc/{pid}") for pid in workers)
