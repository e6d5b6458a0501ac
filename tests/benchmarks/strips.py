"""What the raw echoes of a strip of a synthetic aperture cost, ping by ping.

    python tests/benchmarks/strips.py                       5 x 5 m at 2 cm, 32 receivers, 300 kHz, 25 to 30 m abreast
    python tests/benchmarks/strips.py --against ../other    the same, ping by ping in turn with that checkout
    python tests/benchmarks/strips.py -D thin_below_db=-80  with other attributes of the sonar

The strip is as long as its pings, which overlap by 9 receivers of 32, and as beams are wide. CPU seconds are those of
all threads, medians over pings; the first ping, which compiles kernels, is not counted. Lighting is what makes echoes,
carrying takes them to all receivers and sums them by Doppler classes, and the rest is their pulses, absorption, noise.
"""
import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LENGTH, ALTITUDE, NEAR, FAR = 5.0, 10.0, 25.0, 30.0       # [m]; near and far are abreast
SONAR = {"frequency_khz": 300.0, "bandwidth_khz": 37.5, "pulse_ms": 2.0, "receivers": 32, "banks": 1,
         "receiver_length": 0.04, "transmitter_length": 0.04, "overlap": 9, "speed_knots": 3.0, "heading_deg": 0.0}
STEPS = "light", "carry", "whole"


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", type=Path, help="root of another checkout")
    parser.add_argument("--cell", type=float, default=None, help="[m]; default: the sonar's")
    parser.add_argument("--far", type=float, default=FAR, help="[m]")
    parser.add_argument("-D", dest="attributes", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    (work if arguments.worker else compare)(arguments)


def strip(arguments):
    """Plan a strip over a flat bed of two facets."""
    from mitsonar.scene.loading import prepare
    import mitsuba as mi


    prepare()
    given = dict(one.split("=", 1) for one in arguments.attributes)
    sonar = SONAR | {name: type(SONAR.get(name, 0.0))(value) for name, value in given.items()}
    beside = 300e3 / sonar["frequency_khz"] * 0.005 / sonar["receiver_length"] * arguments.far / 1e3
    advance = 0.5 * (sonar["receivers"] - sonar["overlap"]) * sonar["receiver_length"]
    film = {name: float(np.hypot(abreast, ALTITUDE)) for name, abreast in (("range_min", NEAR),
                                                                           ("range", arguments.far))}
    scene = mi.load_dict({
        "type": "scene", "integrator": {"type": "sonar_path"} | ({"cell": arguments.cell} if arguments.cell else {}),
        "bed": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -20]).scale([60, 60, 1]),
                "bsdf": {"type": "lambert"}},
        "sonar": {"type": "synthetic_aperture", **sonar, "pings": int(np.ceil((LENGTH + beside) / advance)),
                  "start": [0.0, -0.5 * LENGTH, -10.0], "medium": {"type": "seawater"},
                  "film": {"type": "sonar_film", **film}}}, optimize=False)
    return scene.integrator().array_survey(scene, scene.sensors()[0])


def work(arguments):
    """Make a step of a ping as often as lines come in; answer each with CPU and wall seconds and what there was."""
    from mitsonar.survey.pressure import signals
    import drjit as dr

    from mitsonar.survey.pressure.pressure import PressureRecord

    survey = strip(arguments)
    record, made = PressureRecord(survey), {}

    def light(ping):
        echoes = record.at(ping).ensonified
        made["echoes"] = sum(block.count for number, _ in echoes.shares(0) for block in echoes.echoes(number))

    def carry(ping):
        factors = made.get("factors", np.ones(1))
        made["classes"] = len(list(record.at(ping).transmissions(factors)))

    chosen = signals.doppler_classes

    def classes(*arguments_, **named):
        made["factors"] = chosen(*arguments_, **named)
        return made["factors"]

    signals.doppler_classes = classes
    steps = {"light": light, "carry": carry, "whole": lambda ping: signals.received_signals(record, [ping])}
    for line in sys.stdin:
        step, ping = line.split()
        cpu, wall = time.process_time(), time.perf_counter()
        steps[step](int(ping) % survey.track.pings)
        dr.sync_thread()
        print(time.process_time() - cpu, time.perf_counter() - wall, made.get("echoes", 0), made.get("classes", 0),
              survey.track.pings, flush=True)


def compare(arguments):
    """Print the cost of pings of one checkout, or of two in turn and their ratio."""
    import measuring

    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)

    checkouts = {"this": ROOT} | ({"other": arguments.against.resolve()} if arguments.against else {})
    options = ["--worker", "--far", str(arguments.far), *(["--cell", str(arguments.cell)] if arguments.cell else [])]
    options += [f"-D{one}" for one in arguments.attributes]
    workers = {name: subprocess.Popen([sys.executable, __file__, *options], text=True, stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(root)})
               for name, root in checkouts.items()}
    seconds = {name: {step: [] for step in STEPS} for name in checkouts}
    for ping in range(arguments.rounds + 1):
        # the whole first: from it the others have their Doppler factors
        for step in STEPS[::-1]:
            for name, worker in workers.items():
                answer = ask(worker, f"{step} {ping}")
                if ping:
                    seconds[name][step].append(answer)
    rows = []
    for name, worker in workers.items():
        worker.stdin.close()
        worker.wait()
        table = {step: np.median(np.array(answers), axis=0) for step, answers in seconds[name].items()}
        (lit, *_), (carried, *_), (whole, wall, echoes, classes, pings) = (table[step] for step in STEPS)
        given = dict(one.split("=", 1) for one in arguments.attributes)
        receivers = int(given.get("receivers", SONAR["receivers"])) * int(given.get("banks", SONAR["banks"]))
        rows.append([f"{name} checkout", f"{whole:.2f}", f"{wall:.2f}", f"{100 * lit / whole:.0f}",
                     f"{100 * max(carried - lit, 0) / whole:.0f}", f"{100 * max(whole - carried, 0) / whole:.0f}",
                     f"{echoes:,.0f}", f"{classes:.0f}", f"{echoes * receivers / whole / 1e6:.0f}",
                     f"{pings:.0f}", f"{pings * whole:.0f}"])
    print(measuring.machine() + "\n")
    measuring.table(["a ping of", "CPU [s]", "wall [s]", "light [%]", "carry [%]", "rest [%]", "echoes", "classes",
                     "million echoes x receivers a CPU second", "pings", "strip, CPU [s]"], rows)
    if arguments.against:
        ratio = np.median(np.array(seconds["this"]["whole"])[:, 0] / np.array(seconds["other"]["whole"])[:, 0])
        print(f"\nCPU of this checkout over the other: {ratio:.3f}")


def ask(worker, line):
    """Have a step done; give what is answered as numbers."""
    worker.stdin.write(line + "\n")
    worker.stdin.flush()
    answer = worker.stdout.readline()
    if not answer:
        raise SystemExit(f"the benchmark's worker ended with {worker.wait()}")
    return [float(part) for part in answer.split()]


if __name__ == "__main__":
    main()
