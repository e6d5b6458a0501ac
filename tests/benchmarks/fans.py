"""What a frame of a fan costs in the beam domain, stage by stage, and how many times less than by the element chain.

    python tests/benchmarks/fans.py                       512, 256 and 128 beams to 60 m, 256 elements, labels included
    python tests/benchmarks/fans.py --chain               and the shipped scene, both ways, in the same run
    python tests/benchmarks/fans.py --memory 300          and the memory over so many frames
    python tests/benchmarks/fans.py -D range=20 --beams 64

The scene is scenes/forward_looking.xml. Stages are ended by waiting for the device, which makes the whole a little
longer than frames alone; these are measured first. CPU seconds are those of all threads; medians of all rounds but the
first two, which compile.
"""
import argparse
import resource
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LARGE = {"elements": 256, "range": 60, "range_min": 4}


def main(argv=None):
    """Measure and print tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--beams", type=int, nargs="+", default=[512, 256, 128])
    parser.add_argument("-D", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--chain", action="store_true", help="the shipped scene against the element chain")
    parser.add_argument("--memory", type=int, default=0, metavar="FRAMES")
    arguments = parser.parse_args(argv)
    import measuring

    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    print(measuring.machine() + "\n")
    parameters = {**LARGE, **dict(one.split("=", 1) for one in arguments.parameters)}
    for beams in arguments.beams:
        frames = made(beams=beams, **parameters)
        rows = [["a frame", *seconds(lambda: frames.frame(0, 1), arguments.rounds)]]
        rows += staged(frames, arguments.rounds)
        whole, hiding, truth = ([float(value) for value in row[1:]] for row in (rows[0], rows[2], rows[-1]))
        rows.append(["truth and who hides, over the frame",
                     *(f"{(a + b) / c:.2f}" for a, b, c in zip(hiding, truth, whole))])
        measuring.table([f"{beams} beams, {parameters['range']} m", "CPU [ms]", "wall [ms]"], rows)
        print()
    if arguments.memory:
        measuring.table(["frames", "peak [MB]"], memory(made(beams=arguments.beams[0], **parameters), arguments.memory))
        print()
    if arguments.chain:
        measuring.table(["forward_looking.xml, picture and truth", "CPU [ms]", "wall [ms]"], against_chain(arguments))


def made(**parameters):
    """Return the frames of the scene."""
    import mitsonar
    from mitsonar.imaging import fan
    from mitsonar.survey.beam_domain.frames import Frames
    from mitsonar.verbs.images import opened

    scene, sensor, integrator = opened(mitsonar.load_file(ROOT / "scenes" / "forward_looking.xml", **parameters))
    survey = integrator.survey(scene, sensor)
    direction = fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width, sensor.beam_steps)[1]
    return Frames(survey, direction, per_cell=survey.per_cell)


def seconds(work, rounds):
    """CPU and wall [ms] of a frame, medians."""
    import drjit as dr

    cost = []
    for _ in range(2 + rounds):
        cpu, wall = time.process_time(), time.perf_counter()
        work()
        dr.sync_thread()
        cost.append((time.process_time() - cpu, time.perf_counter() - wall))
    return [f"{1e3 * one:.0f}" for one in np.median(cost[2:], axis=0)]


def staged(frames, rounds):
    """Rows of the stages' costs."""
    import drjit as dr

    stages = {"echoes and shadows": (frames.echoes, "of_scatterers"), "who hides": (frames.echoes, "hiding"),
              "targets": (frames.echoes, "of_targets"), "beams: FFTs, line, noise": (frames._beams, "form_each"),
              "truth": (frames._truth, "of")}
    cost = {name: [] for name in stages}

    def timed(name, work):
        def run(*arguments, **named):
            dr.sync_thread()
            cpu, wall = time.process_time(), time.perf_counter()
            result = work(*arguments, **named)
            result = list(result) if name == "targets" else result
            dr.sync_thread()
            cost[name].append((time.process_time() - cpu, time.perf_counter() - wall))
            return result
        return run

    for name, (thing, method) in stages.items():
        setattr(thing, method, timed(name, getattr(thing, method)))
    for _ in range(2 + rounds):
        frames.frame(0, 1)
    for thing, method in stages.values():
        delattr(thing, method)
    return [[f"  {name}", *(f"{1e3 * one:.0f}" for one in np.median(some[2:], axis=0))] for name, some in cost.items()]


def memory(frames, count):
    """Peak resident memory [MB] after the first frames, and after all."""
    rows = []
    for number in range(count):
        frames.frame(0, number)
        if number + 1 in (min(10, count), count):
            rows.append([number + 1, f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}"])
    return rows


def against_chain(arguments):
    """Rows of the shipped scene by both ways, and their ratio."""
    import mitsonar

    scene = mitsonar.load_file(ROOT / "scenes" / "forward_looking.xml",
                               **dict(one.split("=", 1) for one in arguments.parameters))
    sensor, cost = scene.sensors()[0], {}
    sensor.picture = "elements"
    cost["element chain"] = seconds(lambda: mitsonar.render(scene), 1)
    frames = made(**dict(one.split("=", 1) for one in arguments.parameters))
    cost["beam domain"] = seconds(lambda: frames.frame(0, 1), arguments.rounds)
    ratio = [f"{float(a) / float(b):.0f}" for a, b in zip(cost["element chain"], cost["beam domain"])]
    return [*([name, *some] for name, some in cost.items()), ["times less", *ratio]]


if __name__ == "__main__":
    main()
