"""Cost of a step of `mitsonar.Sonar` beside a frame of `mitsonar.frames`, and the memory after many steps.

    python tests/benchmarks/steps.py                      forward_looking.xml as shipped, and small
    python tests/benchmarks/steps.py --memory 2000        and the memory over so many steps

Frames and steps of the same planned poses are timed by turns in one run, ping by ping: CPU seconds of all threads over
their number, medians of all rounds but the first, which compiles. On a track that heaves, every frame and every step
makes a table of rays for its depth. One more step on that track turns, beside the plan.
"""
import argparse
import resource
from dataclasses import replace
from functools import partial

import measuring
import numpy as np

SCENES = {"as shipped": {}, "small": {"elements": 16, "beams": 31, "range": 12, "speed_knots": 1}}
ROOT = measuring.ROOT / "scenes" / "forward_looking.xml"


def main(argv=None):
    """Measure and print tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--scenes", nargs="+", choices=[*SCENES], default=[*SCENES])
    parser.add_argument("--memory", type=int, default=500, metavar="STEPS")
    arguments = parser.parse_args(argv)
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    print(measuring.machine() + "\n")
    for name in arguments.scenes:
        measuring.table([f"{name}, a ping", "CPU [ms]", "wall [ms]", "over a frame"], timed(SCENES[name], arguments))
        print()
    measuring.table(["steps, small", "resident [MB]"], memory(arguments.memory))


def timed(parameters, arguments):
    """Return rows of a table: frames and steps, on a level track and on one that heaves, and steps that turn."""
    import mitsonar
    from mitsonar.sonar.motion.motion import RandomMotion

    work, ratios = {}, []
    for name, heave in (("", 0.0), (", at other depths", 0.05)):
        scene = mitsonar.load_file(ROOT, pings=arguments.rounds + 1, **parameters)
        route = scene.sensors()[0].route
        scene.sensors()[0].route = replace(route, random_motion=RandomMotion(heave=heave, seed=1))
        voyage = scene.integrator().survey(scene, scene.sensors()[0]).voyage
        frames, sonar = mitsonar.frames(scene), mitsonar.Sonar(scene)
        work["a frame" + name], work["a step" + name] = partial(next, frames), stepper(sonar, voyage)
        ratios += ["a frame" + name] * 2
    work["a step that turns"] = stepper(mitsonar.Sonar(scene), voyage, turn=0.2)
    cost = measuring.rounds(work, arguments.rounds)
    return [[name, *(f"{1000 * np.median(clock):.1f}" for clock in (seconds.cpu, seconds.wall)),
             f"{np.median(seconds.cpu) / np.median(cost[frame].cpu):.3f}"]
            for (name, seconds), frame in zip(cost.items(), [*ratios, ratios[-1]])]


def stepper(sonar, voyage, turn=0.0):
    """Return a function that steps a sonar along a planned voyage, where it turns [rad/s] more."""
    numbers, track = iter(range(voyage.track.pings)), voyage.track

    def step():
        ping = next(numbers)
        sonar.ping(position=track.position[ping], velocity=voyage.velocity[ping], time=track.time[ping],
                   attitude=(track.roll[ping], track.pitch[ping], track.heading[ping]),
                   turn_rate=voyage.turn_rate[ping] + [0, 0, turn])
    return step


def memory(steps):
    """Return rows of a table: resident memory after parts of the steps, along a way that winds and dives."""
    import mitsonar

    rows, marks = [], {max(round(steps * share), 1) for share in (0.1, 0.25, 0.5, 0.75, 1.0)}
    with mitsonar.Sonar(ROOT, **SCENES["small"]) as sonar:
        for number in range(1, steps + 1):
            angle = 0.02 * number
            sonar.ping(position=(4 * np.sin(angle), -16 + 4 * np.cos(angle), -16 - 2 * np.sin(0.3 * angle)),
                       attitude=(0, 0, angle), velocity=(0.3, 0, 0), turn_rate=(0, 0, -0.1))
            if number in marks:
                rows.append([number, f"{resident():.1f}"])
    return rows


def resident():
    """Return the resident memory of this process [MB]; where the system does not tell it, the peak."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


if __name__ == "__main__":
    main()
