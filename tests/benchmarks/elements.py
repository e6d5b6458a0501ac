"""What a ping of an array costs, from scene to element signals.

    python tests/benchmarks/elements.py                    by the number of elements: ensonify once, carry to all
    python tests/benchmarks/elements.py --ensonification   two ways to find scatterers: time, and error of the level

A line of receivers looks ahead from 5 m above a rough bed, 300 kHz, 20 kHz of bandwidth, through a summer cast; the
cells' size sets the number of echoes. The second compares, in gates of 0.5 m, the energy Σ|e|² that reaches the array
with that of cells four times smaller in area, connected one by one: all that sampling noise and cell size do.
"""
import argparse

import measuring
import numpy as np

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cast", default=measuring.SUMMER, help="sound-speed cast; default: scenes/casts/summer.csv")
    parser.add_argument("--range", type=float, default=25.0, help="[m]")
    parser.add_argument("--cell", type=float, default=0.24, help="[m]; default 0.24, about 100,000 echoes")
    parser.add_argument("--elements", type=int, nargs="*", default=[1, 4, 16, 64, 256])
    parser.add_argument("--rays", type=int, nargs="*", default=[100_000, 400_000, 1_600_000], help="of the latter")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--ensonification", action="store_true")
    arguments = parser.parse_args(argv)
    (ways_to_ensonify if arguments.ensonification else by_elements)(arguments)


def record_of(arguments, elements=1, **integrator):
    """Plan a ping."""
    from mitsonar.scene.loading import prepare
    import mitsuba as mi

    from mitsonar.survey.pressure.pressure import PressureRecord

    prepare()
    scene = mi.load_dict({
        "type": "scene", "integrator": {"type": "sonar_path", "cell": arguments.cell, **integrator},
        "bed": {"type": "seabed", "depth": 20.0, "length": 80.0, "width": 80.0, "spacing": 0.5, "fractal_rms": 0.1,
                "bsdf": {"type": "lambert"}},
        "sonar": {"type": "array_sonar", "frequency_khz": 300.0, "bandwidth_khz": 20.0, "receive": "line",
                  "receive_elements": elements, "receive_normal": "forward", "receive_baffle": "hard",
                  "start": [0.0, 0.0, -15.0], "heading_deg": 0.0,
                  "medium": {"type": "seawater", "cast": str(arguments.cast)},
                  "film": {"type": "sonar_film", "range": arguments.range}}}, optimize=False)
    return PressureRecord(scene.integrator().array_survey(scene, scene.sensors()[0]))


def ensonified(record):
    """All echoes of the ping, made anew."""
    plan = record.survey
    return list(record.ensonification(0).echoes(plan.track.position[0], plan.track.rotation()[0],
                                             float(plan.depth_below[0]), 0))


def by_elements(arguments):
    """Print ms of ensonifying, of carrying and of reading, by the number of elements."""
    from mitsonar.survey.pressure.echo_classes import SortedEchoes
    import drjit as dr
    import mitsuba as mi


    rows = []
    for elements in arguments.elements:
        record = record_of(arguments, elements)
        echoes, sums = ensonified(record), record.sums()
        delays, late = record.delays(record.at(0).ensonified.source(0), 0), dr.opaque(mi.Float64, 0.0)

        def carry(delays=delays, sums=sums, echoes=echoes, late=late):
            for block in echoes:
                delays.add(sums, SortedEchoes(echoes=block, late=late), 0, weight=1.0)
            dr.eval(sums.sums)
            dr.sync_thread()

        def anew(record=record):
            record.at(0).responses()           # echoes made anew, over the same tables

        cost = measuring.rounds({"ensonify": lambda record=record: ensonified(record), "carry": carry,
                                 "read": sums.read, "all": anew}, arguments.rounds)
        count = sum(block.count for block in echoes)
        wall = {name: 1e3 * np.median(seconds.wall) for name, seconds in cost.items()}
        rows.append([elements, f"{count:,}", *(f"{wall[name]:.1f}" for name in ("ensonify", "carry", "read", "all")),
                     f"{1e3 * np.median(cost['all'].cpu):.1f}", f"{count * elements / wall['carry'] / 1e3:.0f}"])
    print(measuring.machine() + "\n")
    measuring.table(["elements", "echoes", "ensonify [ms]", "carry, return path included [ms]", "read [ms]",
                     "whole ping [ms]", "the same, CPU over threads", "million echoes x elements a second"], rows)


def ways_to_ensonify(arguments):
    """Print time and level error of both ways to find scatterers."""

    def energies(record):
        gates = np.arange(0, 2 * arguments.range / 1500, 1.0 / 1500)
        total = np.zeros(len(gates) - 1)
        for block in ensonified(record):
            # without the cells' chance: |e|² over |g|² is what was ensonified
            total += np.histogram(2 * block.out.travel_time.numpy(), gates, weights=block.energy.numpy())[0]
        return total

    records = {f"scatterers, cells of {arguments.cell} m": record_of(arguments)}
    records.update({f"{rays:,} rays": record_of(arguments, ensonification="rays", rays=rays)
                    for rays in arguments.rays})
    arguments.cell /= 2
    truth = energies(record_of(arguments))
    heard = truth > 1e-6 * truth.max()
    cost = measuring.rounds({name: lambda record=record: ensonified(record) for name, record in records.items()},
                            arguments.rounds)
    rows = []
    for name, record in records.items():
        error = 10 * np.log10(energies(record)[heard] / truth[heard])
        rows.append([name, f"{1e3 * np.median(cost[name].wall):.0f}", f"{1e3 * np.median(cost[name].cpu):.0f}",
                     f"{sum(block.count for block in ensonified(record)):,}",
                     f"{np.sqrt(np.mean(error ** 2)):.3f}", f"{np.abs(error).max():.3f}"])
    print(measuring.machine() + "\n")
    measuring.table(["found by", "wall [ms]", "CPU over threads [ms]", "echoes", "level, rms error [dB]",
                     "largest [dB]"], rows)


if __name__ == "__main__":
    main()
