"""A part of a sweep killed at random moments and resumed each time, against the same sweep run calmly.

    python tests/benchmarks/killed_parts.py                        part 1/2 killed ten times
    python tests/benchmarks/killed_parts.py --longest 60 --seed 2  at other moments, up to 60 s after each start

The part ends at last, part 2/2 is made and both are merged. Samples and manifest must equal those of one calm run, but
for seconds and attempts. Exit code 1 says that they do not.
"""
import argparse
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLAN = """
scene = "minefield"
output = "{{index:06}}.tar"
classes = ["cylinder", "truncated_cone", "sphere", "wedge"]
samples = {samples}
[labels]
negatives = ["rounded_stone", "angular_stone", "crate", "tyre", "drum", "anchor", "clump", "lobster_pot"]
[set]
rays = 20000
pings = 60
bins = 300
[draw]
count = {{ choice = ["0", "1, 3"], weights = [1, 3], stratified = true }}
target_seed = {{ integer = [0, 1000000] }}
"""


def main(argv=None):
    """Kill, resume, merge and compare."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--samples", type=int, default=30)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--longest", type=float, default=30.0, metavar="SECONDS")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    moments = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory(prefix="mitsonar-") as scratch:
        place = Path(scratch)
        (place / "plan.toml").write_text(PLAN.format(samples=arguments.samples), encoding="utf-8")
        started(place, "-o", "calm").wait()
        (place / "killed").mkdir()
        for kill in range(arguments.kills):
            part, after = started(place, "-o", "killed", "--part", "1/2"), moments.uniform(0, arguments.longest)
            time.sleep(after)
            part.send_signal(signal.SIGKILL)
            part.wait()
            print(f"kill {kill + 1:2} after {after:4.1f} s: {len(samples(place / 'killed'))} samples there", flush=True)
        for words in (["--part", "1/2"], ["--part", "2/2"], ["--merge", "killed"]):
            started(place, "-o", "killed", *words).wait()
        calm = content(place / "calm")
        same = calm is not None and len(calm[0]) == arguments.samples and content(place / "killed") == calm
    print(f"{arguments.samples} samples and their manifest are {'the same' if same else 'NOT the same'}")
    return 0 if same else 1


def started(place, *words):
    """Start a sweep of one process."""
    return subprocess.Popen([sys.executable, "-m", "mitsonar", "sweep", "plan.toml", "--processes", "1", *words],
                            cwd=place, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def samples(folder):
    """Return the hashes of the samples in a folder, by name."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("[!.]*.tar"))}


def content(folder):
    """Return the samples of a folder, and its manifest without what the clock says; None without a manifest."""
    manifest = folder / "manifest.jsonl"
    if not manifest.exists():
        return None
    lines = [{**json.loads(line), "seconds": 0, "attempts": 0}
             for line in manifest.read_text(encoding="utf-8").splitlines()]
    return samples(folder), lines


if __name__ == "__main__":
    sys.exit(main())
