"""What a turn of a rotating head costs: its levels by beams, its truth, and how many times less than by elements.

    python tests/benchmarks/turns.py                      a turn of the shipped scene, standing and under way
    python tests/benchmarks/turns.py --elements 4         and so many of its pings by the element chain, in the same run
    python tests/benchmarks/turns.py -D range=10 --pings 40

The scene is scenes/sector_scan.xml. CPU seconds are those of all threads; the first round compiles and is left out.
"""
import argparse
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-D", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--pings", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--elements", type=int, default=0, metavar="PINGS")
    arguments = parser.parse_args(argv)
    import measuring

    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    print(measuring.machine() + "\n")
    parameters = dict(one.split("=", 1) for one in arguments.parameters)
    rows = []
    for name, speed in (("on a tripod", 0), ("at 1 knot", 1)):
        stages = made(pings=arguments.pings, speed_knots=speed, **parameters)
        rows += [[f"{arguments.pings} pings {name}: {stage}", *seconds(work, arguments.rounds)]
                 for stage, work in stages.items() if stage != "elements"]
    if arguments.elements:
        work = made(pings=arguments.elements, **parameters)["elements"]
        rows.append([f"{arguments.elements} pings by elements: levels", *seconds(work, 1)])
    measuring.table(["", "CPU [s]", "wall [s]"], rows)


def made(**parameters):
    """Return the stages of a picture, to be called: echoes and signals by beams, the truth, signals by elements."""
    import mitsonar
    from mitsonar.survey.energy import energy
    from mitsonar.survey.pressure.pressure import PressureRecord
    from mitsonar.survey.pressure.signals import received_signals
    from mitsonar.survey.sector_scan.signals import StepSignals
    from mitsonar.survey.sector_scan.steps import Steps
    from mitsonar.verbs.images import opened

    scene, sensor, integrator = opened(mitsonar.load_file(ROOT / "scenes" / "sector_scan.xml", **parameters))
    survey = integrator.survey(scene, sensor)
    steps = Steps(survey, *sensor.film().window(survey.sound_speed(0)))

    return {"levels": lambda: StepSignals(survey).power(steps.bins.count, 1),
            "truth": lambda: energy.record(survey, steps, 1),
            "elements": lambda: received_signals(PressureRecord(survey, seed=1), range(survey.track.pings))}


def seconds(work, rounds):
    """CPU and wall [s], medians."""
    cost = []
    for _ in range(1 + rounds):
        cpu, wall = time.process_time(), time.perf_counter()
        work()
        cost.append((time.process_time() - cpu, time.perf_counter() - wall))
    return [f"{one:.2f}" for one in np.median(cost[1:], axis=0)]


if __name__ == "__main__":
    main()
