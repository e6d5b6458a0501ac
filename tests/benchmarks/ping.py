"""How long a ping takes, and whether a survey's memory grows with its pings.

    python tests/benchmarks/ping.py                     ms per ping, and what they are spent on
    python tests/benchmarks/ping.py --survey 1000       wall time and peak memory of 250, 500 and 1000 pings

The first: both sides of a 100 kHz sidescan 20 m above a rough bed of two million triangles, 600,000 rays and 800 bins a
ping, refracted through a summer cast, with speckle and noise. The second: the same at 100,000 rays a ping, each survey
in a process of its own, with its image kept and written as an EXR.
"""
import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np

# Mitsuba is imported where it is used: the process that starts the surveys must stay small, because Linux counts the
# memory of a parent into the peak of its child.


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cast", default=measuring.SUMMER, help="sound-speed cast; default: scenes/casts/summer.csv")
    parser.add_argument("--rays", type=int, help="per ping; default 600000, of a survey 100000")
    parser.add_argument("--bins", type=int, default=800)
    parser.add_argument("--nodes", type=int, default=1000, help="of the seabed, along a side; default 1000")
    parser.add_argument("--pings", type=int, default=12, help="in a round; default 12")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--survey", type=int, metavar="PINGS", help="surveys of a quarter, half and all of these pings")
    parser.add_argument("--one", type=int, metavar="PINGS", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.one is not None:
        print(json.dumps(one_survey(arguments)))
    elif arguments.survey is not None:
        surveys(arguments)
    else:
        phases(arguments)


def load(arguments, pings, rays):
    """Load the scene for a number of pings."""
    import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
    import mitsuba as mi

    from mitsonar.scene.loading import prepare

    prepare()
    return mi.load_dict({
        "type": "scene", "bed": measuring.seabed(arguments.nodes),
        "integrator": {"type": "sonar_path", "rays": rays},
        "sonar": {"type": "sidescan", "preset": "towed_100khz", "pings": pings, "altitude": 20.0, "heading_deg": 0.0,
                  "speed_knots": 3.0, "medium": {"type": "seawater", "cast": str(arguments.cast)},
                  "film": {"type": "sonar_film", "range": 100.0, "bins": arguments.bins}}})


def phases(arguments):
    """Print ms per ping of the whole and of its parts."""
    rays, pings = arguments.rays or 600_000, arguments.pings
    scene = load(arguments, pings, rays)
    from dataclasses import replace

    import mitsonar
    from mitsonar.io.records import exr
    from mitsonar.survey.energy.energy import record
    from mitsonar.survey.energy.sides import Sides

    integrator, sensor = scene.integrator(), scene.sensors()[0]
    survey = integrator.survey(scene, sensor)
    one_pass = replace(survey, first_pass=0.0)
    image = mitsonar.render(scene)
    heard = image["rays"].values
    with tempfile.TemporaryDirectory() as folder:
        cost = measuring.rounds({
            "all: mitsonar.render": lambda: mitsonar.render(scene),
            "  track, seabed under it (once a survey)": lambda: integrator.survey(scene, sensor),
            "  rays to echoes, two passes": lambda: record(survey, Sides(survey)),
            "  (the same in one pass, as for a flat bed)": lambda: record(one_pass, Sides(one_pass)),
            "writing the EXR": lambda: exr.write(image, Path(folder) / "image.exr")}, arguments.rounds)
    print(measuring.machine())
    print(f"{measuring.triangles(scene):,} triangles, two sides, {rays:,} rays and {arguments.bins} bins a ping; "
          f"{heard.sum() / image.sizes['ping']:,.0f} rays of the second pass land in the window; medians of "
          f"{arguments.rounds} rounds of {pings} pings\n")
    measuring.table(["ms per ping", "wall", "CPU over threads"],
                    [[name, *(f"{1000 * np.median(clock) / pings:.1f}" for clock in seconds)]
                     for name, seconds in cost.items()])


def one_survey(arguments):
    """Render one survey, write it, and give its cost."""
    scene = load(arguments, arguments.one, arguments.rays or 100_000)
    import mitsonar
    from mitsonar.io.records import exr

    before, start = peak_memory(), time.perf_counter()
    image = mitsonar.render(scene)
    rendered = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        exr.write(image, Path(folder) / "image.exr")
    return {"pings": arguments.one, "render": rendered, "write": time.perf_counter() - start - rendered,
            "before": before, "peak": peak_memory(), "image": image.nbytes / 1e6, "machine": measuring.machine()}


def surveys(arguments):
    """Print time and memory of surveys of growing length."""
    rows, options = [], []
    for name in ("cast", "rays", "bins", "nodes"):
        value = getattr(arguments, name)
        options += [] if value is None else [f"--{name}", str(value)]
    for pings in (arguments.survey // 4, arguments.survey // 2, arguments.survey):
        child = subprocess.run([sys.executable, __file__, "--one", str(max(1, pings)), *options], check=True, text=True,
                               stdout=subprocess.PIPE)
        told = json.loads(child.stdout)
        rows.append([told["pings"], f"{told['render']:.1f}", f"{1000 * told['render'] / told['pings']:.1f}",
                     f"{told['write']:.1f}", f"{told['before']:.0f}", f"{told['peak']:.0f}", f"{told['image']:.0f}"])
    print(told["machine"])
    print(f"{2 * (arguments.nodes - 1) ** 2 / 1e6:.1f} million triangles, two sides, {arguments.rays or 100_000:,} "
          f"rays and {arguments.bins} bins a ping\n")
    measuring.table(["pings", "render [s]", "ms per ping", "write EXR [s]", "peak before [MB]", "peak [MB]",
                     "of it the image [MB]"], rows)


def peak_memory():
    """Largest resident memory of this process so far [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


if __name__ == "__main__":
    main()
