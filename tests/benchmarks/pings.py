"""What a sidescan's ping costs in a survey, and how that compares with another checkout.

    python tests/benchmarks/pings.py                                  CPU a ping of the large bed of ping.py
    python tests/benchmarks/pings.py --against ../other               the same, survey by survey in turn with that one
    python tests/benchmarks/pings.py --scene minefield.xml --rays 200000 --pings 60

Each checkout is one process that keeps its scene and its compiled kernels; the first survey of either is not counted.
CPU seconds are those of all threads, of `mitsonar.render` as a whole: what a survey works out once is shared by its
pings.
"""
import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import measuring
import numpy as np
import ping


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", type=Path, help="root of another checkout")
    parser.add_argument("--scene", help="of this checkout's scenes/, or a path; default: the bed of ping.py")
    parser.add_argument("--nodes", type=int, default=1000, help="of that bed, along a side; default 1000")
    parser.add_argument("--rays", type=int, default=600_000, help="per ping; default 600000")
    parser.add_argument("--pings", type=int, default=48, help="of a survey; default 48")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--worker", type=Path, metavar="ROOT", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    (work if arguments.worker else compare)(arguments)


def work(arguments):
    """Render surveys as often as lines come in; answer each with CPU and wall seconds a ping."""
    sys.path.insert(0, str(arguments.worker))
    import mitsonar

    if arguments.scene:
        scene = mitsonar.load_file(measuring.ROOT / "scenes" / arguments.scene, pings=arguments.pings,
                                   rays=arguments.rays)
    else:
        scene = ping.load(argparse.Namespace(nodes=arguments.nodes, bins=800, cast=measuring.SUMMER), arguments.pings,
                          arguments.rays)
    for _ in sys.stdin:
        cpu, wall = time.process_time(), time.perf_counter()
        mitsonar.render(scene)
        print((time.process_time() - cpu) / arguments.pings, (time.perf_counter() - wall) / arguments.pings, flush=True)


def compare(arguments):
    """Print the cost of a ping of one checkout, or of two in turn and their ratio."""
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    checkouts = {"this": measuring.ROOT} | ({"other": arguments.against.resolve()} if arguments.against else {})
    options = [f"--{name}={getattr(arguments, name)}" for name in ("nodes", "rays", "pings")]
    options += [f"--scene={arguments.scene}"] if arguments.scene else []
    workers = {name: subprocess.Popen([sys.executable, __file__, f"--worker={root}", *options], text=True,
                                      stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                      env={**os.environ, "PYTHONPATH": str(root)})
               for name, root in checkouts.items()}
    cost = {name: [] for name in workers}
    for count in range(1 + arguments.rounds):
        for name, worker in workers.items():
            worker.stdin.write("survey\n")
            worker.stdin.flush()
            seconds = [float(number) for number in worker.stdout.readline().split()]
            if count:
                cost[name].append(seconds)
    for worker in workers.values():
        worker.stdin.close()
        worker.wait()
    print(measuring.machine())
    print(f"{arguments.scene or 'the bed of ping.py'}, {arguments.rays:,} rays a ping; medians of {arguments.rounds} "
          f"surveys of {arguments.pings} pings\n")
    middle = {name: np.median(seconds, axis=0) for name, seconds in cost.items()}
    rows = [[f"{name} checkout", *(f"{1000 * part:.1f}" for part in middle[name])] for name in workers]
    if "other" in middle:
        rows.append(["this over other", *(f"{ratio:.2f}" for ratio in middle["this"] / middle["other"])])
    measuring.table(["ms a ping", "CPU, all threads", "wall"], rows)


if __name__ == "__main__":
    main()
