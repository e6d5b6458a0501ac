"""What a law of scattering costs: `sediment` and others against `lambert`, in one run.

    python tests/benchmarks/scattering.py

Two questions, and the answer as the ratio to lambert's time, round by round:

- the whole traced ping: rays out, refracted, materials, echoes into bins, as `ping.py` renders it; aim 2 at most;
- the law alone: `materials.scattering_strength` of hits that are there already (points, normals, directions, in
  memory), frames and dispatch included, which every law needs; aim 2 as well. The same towards given directions.
"""
import argparse
from functools import partial
from types import SimpleNamespace

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
import drjit as dr
import measuring
import mitsuba as mi
import numpy as np

from mitsonar.scene import materials
from mitsonar.scene.loading import prepare
from mitsonar.survey.energy.energy import record
from mitsonar.survey.energy.sides import Sides

FREQUENCY = 100e3
LAWS = {
    "lambert": {"type": "lambert"},
    "sediment": {"type": "sediment", "sediment": "medium sand"},
    "sediment, w2 and gamma textured": {"type": "sediment", "w2": "w2", "gamma": "gamma"},
    "sediment, mesh_resolution": {"type": "sediment", "mesh_resolution": 0.5},
    "elastic": {"type": "elastic", "sediment": "cobble"},
}
TEXTURES = {"w2": (1e-5, 2e-4), "gamma": (3.0, 3.4)}


def main(argv=None):
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rays", type=int, default=600_000, help="of a ping; default 600000")
    parser.add_argument("--hits", type=int, default=1 << 20, help="of the law alone; default 1048576")
    parser.add_argument("--nodes", type=int, default=1000, help="of the seabed, along a side; default 1000")
    parser.add_argument("--pings", type=int, default=6, help="in a round; default 6")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args(argv)
    prepare()
    laws = {name: law(description) for name, description in LAWS.items()}
    print(measuring.machine())
    print(f"{arguments.rays:,} rays a ping, {arguments.hits:,} hits, {FREQUENCY / 1e3:g} kHz; medians of "
          f"{arguments.rounds} rounds\n")
    pings = measuring.rounds({name: ping(description, arguments) for name, description in laws.items()},
                             arguments.rounds)
    show("whole traced ping", pings, "ms a ping", 1e3 / arguments.pings)
    seen = hits(arguments.hits)
    alone = {name: stage(description, seen) for name, description in laws.items()}
    show("law alone, straight back", measuring.rounds(alone, arguments.rounds, warm_up=2), "ns a hit",
         1e9 / arguments.hits)
    towards = {name: stage(description, seen, bistatic=True) for name, description in laws.items()}
    show("law alone, two directions", measuring.rounds(towards, arguments.rounds, warm_up=2), "ns a hit",
         1e9 / arguments.hits)


def law(description):
    """Put textures of two by two pixels where a law's description names one."""
    def texture(values):
        return {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.resize(np.float32(values), (2, 2, 1)))}

    return {name: texture(TEXTURES[value]) if value in TEXTURES else value for name, value in description.items()}


def ping(description, arguments):
    """A function that makes the echoes of some pings over a bed of this material."""
    bed = measuring.seabed(arguments.nodes)
    bed["bsdf"] = description
    scene = mi.load_dict({
        "type": "scene", "bed": bed, "integrator": {"type": "sonar_path", "rays": arguments.rays},
        "sonar": {"type": "sidescan", "preset": "towed_100khz", "pings": arguments.pings, "altitude": 20.0,
                  "heading_deg": 0.0, "speed_knots": 3.0,
                  "medium": {"type": "seawater", "cast": str(measuring.SUMMER)},
                  "film": {"type": "sonar_film", "range": 100.0, "bins": 800}}}, optimize=False)
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    return partial(record, survey, Sides(survey))


def hits(count):
    """Hits at all grazing angles on facets a little tilted."""
    rng = np.random.default_rng(3)
    grazing, heading = np.arcsin(rng.uniform(0.05, 1, count)), rng.uniform(0, 2 * np.pi, count)
    arrival = np.stack([np.cos(grazing) * np.cos(heading), np.cos(grazing) * np.sin(heading), -np.sin(grazing)])
    normal = np.concatenate([0.05 * rng.standard_normal((2, count)), np.ones((1, count))])
    normal /= np.linalg.norm(normal, axis=0)
    seen = SimpleNamespace(
        point=mi.Point3f(rng.uniform(-50, 50, (3, count)).astype(np.float32)), normal=mi.Vector3f(np.float32(normal)),
        arrival_direction=mi.Vector3f(np.float32(arrival)), sound_speed=mi.Float64(np.full(count, 1500.0)),
        uv=mi.Point2f(rng.uniform(0, 1, (2, count)).astype(np.float32)), primitive=dr.zeros(mi.UInt32, count))
    dr.eval(*vars(seen).values())
    return seen


def stage(description, seen, bistatic=False):
    """A function that asks the material of a shape for its strength at the hits."""
    shape = mi.load_dict({"type": "rectangle", "bsdf": description})
    own = SimpleNamespace(**vars(seen), smooth=None, shape=dr.full(mi.ShapePtr, shape, dr.width(seen.primitive)))
    back = mi.Vector3f(seen.arrival_direction.y, -seen.arrival_direction.x, -seen.arrival_direction.z)
    active = mi.Bool(True)

    def work():
        if bistatic:
            found = materials.bistatic_strength(own, back, active, FREQUENCY)
        else:
            found = materials.scattering_strength(own, active, FREQUENCY)
        dr.eval(*found)
        dr.sync_thread()

    work.keeps = shape
    return work


def show(title, cost, unit, scale):
    """Print a table of one question."""
    rows = []
    for name, seconds in cost.items():
        ratios = [f"{np.median(clock / of_lambert):.2f}" for clock, of_lambert in zip(seconds, cost["lambert"])]
        rows.append([name, *(f"{scale * np.median(clock):.2f}" for clock in seconds), *ratios])
    measuring.table([f"{title} [{unit}]", "wall", "CPU over threads", "wall ratio", "CPU ratio"], rows)
    print()


if __name__ == "__main__":
    main()
