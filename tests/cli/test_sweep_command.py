"""The command `sweep` with real processes: same bytes however it is run, kills survived, and what it says."""
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import mitsonar
from mitsonar.cli import main as cli

ROOT = Path(__file__).resolve().parents[2]
PLAN = """
scene = "scene.xml"
output = "{index}_{range}.exr"
[set]
pings = 2
[grid]
range = [30, 40, 50]
[list]
rays = [1000, 1500]
"""
NAMES = [f"{index}_{reach}.exr" for index, reach in enumerate([30, 40, 50] * 2)]


@pytest.fixture
def plan(folder):
    """The folder of the small scene, with a plan of six renders."""
    (folder / "plan.toml").write_text(PLAN, encoding="utf-8")
    return folder


def left(folder):
    """Outputs, and the manifest's last line about each without what the clock says."""
    records = [json.loads(line) for line in (folder / "manifest.jsonl").read_text(encoding="utf-8").splitlines()]
    files = {path.name: path.read_bytes() for path in folder.iterdir()
             if path.name not in ("manifest.jsonl", ".sweep.lock")}
    return files, {record["output"]: {**record, "seconds": None, "attempts": None} for record in records}


def complaints(err):
    """What was said beside progress, which a slow machine shows."""
    return re.sub(r"^\d+ of \d+ renders, (.* left|timing the next)(, \d+ failed)?\n", "", err, flags=re.M)


@pytest.mark.slow
def test_same_bytes_by_one_process_and_two_and_dask_and_as_rendered_alone(plan, capfd, dask_workers, kept):
    assert cli.main(["sweep", "plan.toml", "--processes", "1"]) == 0
    out, err = capfd.readouterr()
    assert out.startswith("6 renders: 6 rendered in 0:00:") and out.endswith(f"\n{plan}/plan/manifest.jsonl\n")
    assert cli.main(["sweep", "plan.toml", "-o", "two", "--processes", "2", "--threads", "3"]) == 0
    assert cli.main(["sweep", "plan.toml", "-o", "dask", "--workers", "2"]) == 0
    assert complaints(err + capfd.readouterr().err) == ""
    assert left(plan / "plan") == left(plan / "two") == left(plan / "dask")
    assert sorted(left(plan / "plan")[0]) == NAMES
    sets = {record["instruction_set"] for record in left(plan / "two")[1].values()}
    assert sets == {mitsonar.llvm.instruction_set()} == {mitsonar.read(plan / "two" / NAMES[0]).instruction_set}
    seed = left(plan / "two")[1]["4_40.exr"]["seed"]
    assert cli.main(["render", "scene.xml", "-o", "alone.exr", "--seed", str(seed), "-D", "pings=2", "-D", "rays=1500",
                     "-D", "range=40"]) == 0
    assert (plan / "alone.exr").read_bytes() == left(plan / "two")[0]["4_40.exr"]
    capfd.readouterr()
    assert cli.main(["sweep", "plan.toml"]) == 0
    assert capfd.readouterr().out.startswith("6 renders: nothing to do, 6 already there\n")
    (plan / "plan" / "4_40.exr").unlink()
    assert cli.main(["sweep", "plan.toml", "--dry-run", "--processes", "1"]) == 0
    there, duration, disk, *_ = capfd.readouterr().out.splitlines()
    assert there == f"6 renders into {plan}/plan, 5 of them there"
    assert "s each (as the existing ones took), by 1 process of " in duration and " are free" in disk


@pytest.mark.slow
def test_a_running_cluster_is_used_and_left_running(plan, capfd):
    import distributed

    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False,
                                  dashboard_address=None) as cluster:
        assert cli.main(["sweep", "plan.toml", "--scheduler", cluster.scheduler_address]) == 0
        assert complaints(capfd.readouterr().err) == ""
        with distributed.Client(cluster) as client:
            assert client.submit(sum, [1, 2]).result() == 3
    assert sorted(left(plan / "plan")[0]) == NAMES


@pytest.mark.slow
def test_previews_and_folders_of_their_own(plan):
    (plan / "plan.toml").write_text('scene = "scene.xml"\npreviews = true\noutput = "{pings}/{range}.exr"\n[set]\n'
                                    'pings = 2\nrange = 40\n', encoding="utf-8")
    assert cli.main(["sweep", "plan.toml"]) == 0
    assert {path.name for path in (plan / "plan" / "2").iterdir()} == {"40.exr", "40.png"}


def test_what_fails_is_told_and_the_rest_is_rendered(plan, capfd):
    (plan / "plan.toml").write_text('scene = "scene.xml"\n[grid]\nrays = [1000, 0, 2000]\n', encoding="utf-8")
    assert cli.main(["sweep", "plan.toml", "--processes", "1"]) == 1
    out, err = capfd.readouterr()
    err = complaints(err)
    assert out.startswith("3 renders: 2 rendered in ") and ", 1 failed\n" in out
    assert err.startswith("mitsonar: 000001.exr failed: ") and "rays is the integer 0" in err and err.count("\n") == 1
    record = left(plan / "plan")[1]["000001.exr"]
    assert record["status"] == "failed" and "rays is the integer 0" in record["error"]


def start(folder, *options):
    return subprocess.Popen([sys.executable, "-m", "mitsonar", "sweep", "plan.toml", *options], cwd=folder, text=True,
                            env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def children(process):
    """Numbers of the processes that a process has started, by whichever of its threads."""
    return [int(number) for path in Path(f"/proc/{process}/task").glob("*/children")
            for number in path.read_text(encoding="utf-8").split()]


def wait_for(happens, seconds=60):
    deadline = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="needs Linux's /proc to find the processes")
def test_kills_and_interruptions_leave_nothing_unfinished_and_lose_nothing(plan, kept):
    (plan / "plan.toml").write_text("seeds = 3\n" + PLAN, encoding="utf-8")
    assert cli.main(["sweep", "plan.toml", "-o", "calm", "--processes", "1"]) == 0
    lines = plan / "plan" / "manifest.jsonl"

    def written():
        return lines.read_text(encoding="utf-8").count("\n") if lines.exists() else 0

    child = start(plan, "--processes", "1")                        # the runner is killed
    wait_for(lambda: written() >= 1)
    (worker,) = children(child.pid)
    child.kill()
    child.communicate()
    wait_for(lambda: not os.path.exists(f"/proc/{worker}"), 10)    # nobody goes on by himself

    before = written()
    child = start(plan, "--processes", "1")                        # its process is killed, then it is interrupted
    wait_for(lambda: written() > before)
    os.kill(children(child.pid)[0], signal.SIGKILL)
    before = written()
    wait_for(lambda: written() > before + 2)
    child.send_signal(signal.SIGINT)
    assert child.communicate()[1].endswith("mitsonar: interrupted; no unfinished file is left\n")
    assert child.returncode == 130
    assert not [name for name in os.listdir(plan / "plan") if name.startswith(".0")]

    assert cli.main(["sweep", "plan.toml", "--processes", "1"]) == 0
    assert left(plan / "plan") == left(plan / "calm")


def test_a_process_that_dies_says_how(plan):
    import threading

    from mitsonar.sweep.pools.local import Renderer

    renderer, answers = Renderer(2, str(plan)), []
    waiting = threading.Thread(target=lambda: answers.append(renderer({"versions": {}})))
    waiting.start()
    wait_for(lambda: renderer._process is not None)
    renderer._process.send_signal(signal.SIGKILL)
    waiting.join()
    assert answers[0]["error"] == "the process that rendered it ended by signal 9 (Killed)"
    assert "other versions" in renderer({"versions": {}})["error"]  # another one has been started
    renderer.kill()
