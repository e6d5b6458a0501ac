"""What a step of `mitsonar.Sonar` costs beside a frame of `mitsonar.frames`, and whether steps gather memory.

    python tests/benchmarks/steps.py                      forward_looking.xml as shipped, and small
    python tests/benchmarks/steps.py --memory 2000        and the memory over so many steps

Frames and steps of the same planned poses are timed by turns in one run, ping by ping: CPU seconds of all threads over
their number, medians of all rounds but the first, which compiles. Two more steps are beside the plan: at a depth of
their own, whose table of rays is made for them, and turning.
"""
import argparse
import resource

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
    """Return rows of a table: a frame, and steps."""
    import mitsonar

    pings = arguments.rounds + 2
    scene = mitsonar.load_file(ROOT, pings=pings, **{**{"speed_knots": 1}, **parameters})
    voyage = scene.integrator().survey(scene, scene.sensors()[0]).voyage
    track, frames = voyage.track, mitsonar.frames(scene)
    planned, deeper, turning = (mitsonar.Sonar(scene) for _ in range(3))
    number = {planned: 0, deeper: 0, turning: 0}

    def step(sonar, lower=0.0, turn=0.0):
        ping = number[sonar]
        number[sonar] = ping + 1
        sonar.ping(position=track.position[ping] - [0, 0, lower * (ping % 7)], velocity=voyage.velocity[ping],
                   attitude=(track.roll[ping], track.pitch[ping], track.heading[ping]), time=track.time[ping],
                   turn_rate=voyage.turn_rate[ping] + [0, 0, turn])

    cost = measuring.rounds({
        "a frame": lambda: next(frames), "a step": lambda: step(planned),
        "a step at another depth": lambda: step(deeper, lower=0.01),
        "a step that turns": lambda: step(turning, turn=0.2)}, arguments.rounds)
    by_frame = np.median(cost["a frame"].cpu)
    return [[name, *(f"{1000 * np.median(clock):.1f}" for clock in (seconds.cpu, seconds.wall)),
             f"{np.median(seconds.cpu) / by_frame:.3f}"] for name, seconds in cost.items()]


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
