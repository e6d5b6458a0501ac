"""What echoes of several bounces cost over a plain ping, and how noisy they are.

    python tests/benchmarks/multipath.py
    python tests/benchmarks/multipath.py -Dwind_speed=0 --depths 2 3

The harbour of scenes/sidescan_harbour.xml: CPU of its records alone, without pictures, with every `max_depth` in turn,
in rounds. The noise is that of the sum of paths of more bounces, over seeds, in bins within 40 dB of its loudest: mean
of the variance over the square of the mean, the same times CPU, and the brightest bin over the mean of the other seeds.
"""
import argparse

import measuring
import numpy as np

LOUD = 1e-4                        # of the loudest bin


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-D", dest="given", action="append", default=[], metavar="NAME=VALUE", help="of the scene")
    parser.add_argument("--depths", type=int, nargs="+", default=[2], help="bounces at most; default 2")
    parser.add_argument("--pings", type=int, default=10, help="in a round; default 10")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=8, help="of the noise; default 8")
    arguments = parser.parse_args(argv)
    given = dict(pair.split("=", 1) for pair in arguments.given)
    runs = {depth: run(depth, arguments.pings, given) for depth in (1, *arguments.depths)}
    cost = measuring.rounds(runs, arguments.rounds)
    print(measuring.machine())
    print(f"medians of {arguments.rounds} rounds of {arguments.pings} pings; {arguments.seeds} seeds\n")
    plain, rows = float(np.median(cost[1].cpu)), []
    for depth, seconds in cost.items():
        cpu = float(np.median(seconds.cpu))
        row = [f"max_depth {depth}", f"{1000 * cpu / arguments.pings:.1f}", f"{cpu / plain:.2f}"]
        rows.append(row + (["-"] * 3 if depth == 1 else noise(runs[depth], arguments.seeds, cpu / arguments.pings)))
    measuring.table(["", "CPU over threads, ms per ping", "plain pings", "relative variance", "times CPU [ms]",
                     "brightest [dB]"], rows)


def run(depth, pings, given):
    """Make what makes a record of the harbour, called with a seed."""
    import mitsonar
    from mitsonar.survey.energy.energy import EnergyBlock
    from mitsonar.survey.energy.sides import Sides

    given = {"pings": "60", **given, "max_depth": str(depth)}
    scene = mitsonar.load_file(str(measuring.ROOT / "scenes" / "sidescan_harbour.xml"), **given)
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    rows = Sides(survey)

    def made(seed=0):
        return rows, survey.paths.names, EnergyBlock(survey, rows, seed).echoes(np.arange(pings))

    return made


def noise(made, seeds, seconds):
    """Return the columns of noise."""
    powers = []
    for seed in range(seeds):
        rows, names, echoes = made(seed)
        several = [number for number, name in enumerate(names) if len(name) > 1]
        powers.append(rows.shown(echoes.path_intensity[:, several].sum(1)))
    power = np.array(powers)
    others = (power.sum(0) - power) / (seeds - 1)
    loud = power.mean(0) > LOUD * power.mean(0).max()
    ratio = power[:, loud] / np.maximum(others[:, loud], LOUD * power.mean(0).max())
    variance = float(((power[:, loud] / power.mean(0)[loud] - 1) ** 2).sum(0).mean() / (seeds - 1))
    return [f"{variance:.2f}", f"{1000 * seconds * variance:.1f}", f"{10 * np.log10(ratio.max()):.1f}"]


if __name__ == "__main__":
    main()
