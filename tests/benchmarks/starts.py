"""What a command costs before its work begins, in CPU seconds of all its threads.

    python tests/benchmarks/starts.py                    every command, kernels kept and kernels compiled anew
    python tests/benchmarks/starts.py --against FOLDER   the same beside another checkout, in turns

Each command is a process of its own, on a scene so small that little is left but the start: imports, plugins, loading,
tracing of kernels. Kernels are kept in a folder of the benchmark's own, which is full or empty.
"""
import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import measuring

SMALL = ["-D", "pings=2", "-D", "rays=1000"]
COMMANDS = {
    "import mitsonar": ["-c", "import mitsonar"],
    "--help": ["-m", "mitsonar", "--help"],
    "mitsonar.load_file": ["-c", "import mitsonar; mitsonar.load_file('sidescan_flat')"],
    "describe": ["-m", "mitsonar", "describe", "sidescan_flat"],
    "show": ["-m", "mitsonar", "show", "sidescan_flat", "-o", "{out}.png"],
    "render, a sidescan": ["-m", "mitsonar", "render", "sidescan_flat", "-o", "{out}.exr", *SMALL],
    "render, a frame": ["-m", "mitsonar", "render", "forward_looking", "-o", "{out}.exr", "-D", "pings=1"],
    "soundings": ["-m", "mitsonar", "soundings", "multibeam", "-o", "{out}.nc", "-D", "pings=1"],
    "labels": ["-m", "mitsonar", "labels", "{image}", "-o", "{out}", "--masks"],
    "sweep --dry-run": ["-m", "mitsonar", "sweep", str(measuring.ROOT / "scenes" / "gallery.toml"), "--dry-run",
                        "-o", "{out}"],
}


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="another checkout")
    parser.add_argument("--only", action="append", metavar="NAME", help="a command of the table; repeatable")
    arguments = parser.parse_args(argv)
    trees = {"here": measuring.ROOT, **({"there": arguments.against.resolve()} if arguments.against else {})}
    chosen = {name: COMMANDS[name] for name in arguments.only or COMMANDS}
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "image.exr"
        run([*COMMANDS["render, a sidescan"]], trees["here"], Path(folder) / "image", Path(folder) / "kept", image)
        rows = []
        for name, command in chosen.items():
            seconds = {(tree, kept): [] for tree in trees for kept in (True, False)}
            for turn in range(arguments.rounds + 1):
                for tree, kept in seconds:
                    with tempfile.TemporaryDirectory(dir=folder) as place:
                        kernels = Path(folder) / "kept" if kept else Path(place) / "kernels"
                        cost = run(command, trees[tree], Path(place) / "out", kernels, image)
                    if turn:                    # the first round fills caches
                        seconds[tree, kept].append(cost)
            rows.append([name, *(f"{statistics.median(values):.2f}" for values in seconds.values())])
    print(measuring.machine())
    print(f"CPU seconds, medians of {arguments.rounds}\n")
    measuring.table(["command", *(f"{tree}, {'kept' if kept else 'compiled'}" for tree in trees
                                  for kept in (True, False))], rows)


def run(command, tree, out, kernels, image):
    """Run a command in a process of its own; return the CPU seconds of the process and its children."""
    kernels.mkdir(exist_ok=True)
    environment = {**os.environ, "PYTHONPATH": str(tree), "DRJIT_CACHE_DIR": str(kernels)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *(word.format(out=out, image=image) for word in command)], env=environment,
                          cwd=tree, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
