"""Sweeps of many small renders: speed, overhead, the same bytes everywhere, and what kills and full disks leave.

    sweep.py                       one process, two, and a Dask cluster of two workers: seconds, overhead, same bytes
    sweep.py --kills 20            kill -9 of the runner and of its processes at random moments, resumed each time

Every way renders into an empty folder, from the plan's file to the last line of the manifest, all renders and a quarter
of them: what more renders add in time is their own, the rest is the start. Of what a render adds, the processes that
render say how long they were at it; the remainder is overhead. Kills spring at moments drawn evenly over an undisturbed
run; after the last one the sweep runs to its end, and outputs and manifest are compared with the undisturbed run's.
"""
import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "inputs"))

from measuring import ROOT, machine, table  # noqa: E402  (found by the path above)
from small_scene import TEXT  # noqa: E402  (found by the path above)

PLAN = """
scene = "scene.xml"
seed = 11
samples = {samples}
[set]
pings = 3
[grid]
range = [40, 50]
[draw]
rays = {{ integer = [1000, 3000] }}
"""
WAYS = {"one process": ["--processes", "1"], "two processes": ["--processes", "2"],
        "Dask, two workers": ["--workers", "2"]}


def start(folder, *options):
    """Start the sweep of the plan in `folder`, in a session of its own."""
    return subprocess.Popen([sys.executable, "-m", "mitsonar", "sweep", "plan.toml", *options], cwd=folder,
                            env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, start_new_session=True)


def finish(folder, *options):
    """Run the sweep to its end, and give the seconds it took."""
    begin = time.perf_counter()
    child = start(folder, *options)
    said = child.communicate()
    if child.returncode != 0:
        sys.exit(f"the sweep ended with {child.returncode}: {said}")
    return time.perf_counter() - begin


def outputs(folder):
    """SHA-256 of every file but the manifest and the lock; temporary files, left over, count as well."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())
            if path.name not in ("manifest.jsonl", ".sweep.lock")}


def lines(folder):
    """The manifest's records."""
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]


def last(folder):
    """The last record of every output, without what the clock says and how often it was tried."""
    return {record["output"]: {key: item for key, item in record.items() if key not in ("seconds", "attempts")}
            for record in lines(folder)}


def children(process):
    """Numbers of the processes that a process has started, and those have."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == process:
            found += [int(status.parent.name), *children(int(status.parent.name))]
    return found


def compare_ways(folder, renders):
    """Time every way, and compare what it wrote."""
    rows, first, base = [], None, None
    for way, options in WAYS.items():
        seconds, took, cpu = [], [], []
        for samples in (renders // 8, renders // 8, renders // 2):         # the first compiles kernels and reads files
            (folder / "plan.toml").write_text(PLAN.format(samples=samples), encoding="utf-8")
            shutil.rmtree(folder / "out", ignore_errors=True)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds.append(finish(folder, "-o", "out", *options))
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
            records = lines(folder / "out")
            took.append(sum(record["seconds"] for record in records))
        found, processes, more = outputs(folder / "out"), int(options[1]), len(records) - 2 * (renders // 8)
        added, own = (seconds[2] - seconds[1]) / more, (took[2] - took[1]) / more
        first, base = first or found, base or seconds[2]
        rows.append([way, f"{seconds[2]:.1f}", f"{base / seconds[2]:.2f}", f"{seconds[2] - added * len(records):.1f}",
                     f"{1e3 * (cpu[2] - cpu[1]) / more:.0f}", f"{1e3 * own:.0f}",
                     f"{1e3 * (added * processes - own):.0f}",
                     "yes" if found == first and len(records) == len(found) else "NO"])
    table([f"{len(records)} renders by", "s", "speed-up", "start [s]", "CPU [ms]", "a render [ms]", "overhead [ms]",
           "same bytes"], rows)


def compare_kills(folder, kills, seed):
    """Kill the runner or one of its processes at random moments, resume, and compare with an undisturbed run."""
    chance, options = random.Random(seed), ("--processes", "2")
    whole = finish(folder, "-o", "undisturbed", *options)
    runners = workers = busy = 0
    for _ in range(kills):
        child = start(folder, "-o", "out", *options)
        time.sleep(chance.uniform(0, whole / 4))
        victims = children(child.pid)
        busy += bool(victims)
        if victims and chance.random() < 0.5:
            os.kill(chance.choice(victims), signal.SIGKILL)
            workers += 1
            time.sleep(chance.uniform(0, whole / 10))
        else:
            runners += 1
        orphans = children(child.pid)
        child.kill()
        child.communicate()
        deadline = time.monotonic() + 10
        while any(os.path.exists(f"/proc/{orphan}") for orphan in orphans) and time.monotonic() < deadline:
            time.sleep(0.05)
        if any(os.path.exists(f"/proc/{orphan}") for orphan in orphans):
            sys.exit("a process outlived its runner")
    done = len(last(folder / "out")) if (folder / "out" / "manifest.jsonl").exists() else 0
    finish(folder, "-o", "out", *options)
    same = outputs(folder / "out") == outputs(folder / "undisturbed")
    table(["kill -9", "times", "amid renders", "before the last run", "renders", "outputs the same",
           "manifest the same"],
          [["runner alone", runners, "", "", "", "", ""],
           ["process, then runner", workers, busy, done, len(outputs(folder / "out")), "yes" if same else "NO",
            "yes" if last(folder / "out") == last(folder / "undisturbed") else "NO"]])
    return same


def main():
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renders", type=int, default=200, help="a multiple of 8")
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    import mitsonar  # noqa: F401  (chooses libLLVM)

    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.xml").write_text(TEXT, encoding="utf-8")
        (folder / "plan.toml").write_text(PLAN.format(samples=max(1, arguments.renders // 2)), encoding="utf-8")
        if arguments.kills:
            compare_kills(folder, arguments.kills, arguments.seed)
        else:
            compare_ways(folder, arguments.renders)


if __name__ == "__main__":
    main()
