"""What a frame of an imaging sonar costs by the chain over elements, and how that compares with another checkout.

    python tests/benchmarks/frame.py                              CPU and wall of a frame of scenes/forward_looking.xml
    python tests/benchmarks/frame.py --against ../other           the same, frame by frame in turn with that checkout
    python tests/benchmarks/frame.py -D range=14 -D elements=32   with other parameters of the scene

Each checkout is one process that keeps its scene and its compiled kernels; the first frame of either is not counted.
CPU seconds are those of all threads. Signals are what the elements hear; the picture adds beams and their truth.
"""
import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
STEPS = "signals", "picture"


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", type=Path, help="root of another checkout")
    parser.add_argument("--scene", default="forward_looking.xml", help="of this checkout's scenes/, or a path")
    parser.add_argument("-D", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    (work if arguments.worker else compare)(arguments)


def work(arguments):
    """Make frames as often as lines come in; answer each with CPU and wall seconds."""
    import mitsonar

    scene = mitsonar.load_file(ROOT / "scenes" / arguments.scene,
                               **dict(one.split("=", 1) for one in arguments.parameters))
    scene.sensors()[0].picture = "elements"             # not in the beam domain
    steps = {"signals": lambda: mitsonar.element_signals(scene), "picture": lambda: mitsonar.render(scene)}
    for line in sys.stdin:
        cpu, wall = time.process_time(), time.perf_counter()
        steps[line.strip()]()
        print(time.process_time() - cpu, time.perf_counter() - wall, flush=True)


def compare(arguments):
    """Print the cost of frames of one checkout, or of two in turn and their ratio."""
    import measuring

    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    checkouts = {"this": ROOT} | ({"other": arguments.against.resolve()} if arguments.against else {})
    options = ["--worker", "--scene", arguments.scene]
    options += [f"-D{one}" for one in arguments.parameters]
    workers = {name: subprocess.Popen([sys.executable, __file__, *options], text=True, stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(root)})
               for name, root in checkouts.items()}

    def frame(name, step):
        workers[name].stdin.write(step + "\n")
        workers[name].stdin.flush()
        return [float(number) for number in workers[name].stdout.readline().split()]

    cost = {(name, step): [] for step in STEPS for name in workers}
    for count in range(1 + arguments.rounds):
        for name, step in cost:
            seconds = frame(name, step)
            if count:
                cost[name, step].append(seconds)
    for worker in workers.values():
        worker.stdin.close()
        worker.wait()
    print(measuring.machine() + "\n")
    rows = []
    for step in STEPS:
        middle = {name: np.median(cost[name, step], axis=0) for name in workers}
        for name in workers:
            rows.append([f"{step}, {name} checkout", *(f"{seconds:.2f}" for seconds in middle[name])])
        if "other" in middle:
            rows.append([f"{step}, other over this", *(f"{ratio:.2f}" for ratio in middle["other"] / middle["this"])])
    measuring.table(["a frame", "CPU [s]", "wall [s]"], rows)


if __name__ == "__main__":
    main()
