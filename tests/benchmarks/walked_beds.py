"""A bed that is a grid, walked from cell to cell and in Embree's tree: rays, and loading with and without the tree.

    python tests/benchmarks/walked_beds.py                         the beds of three shipped scenes
    python tests/benchmarks/walked_beds.py --scene sidescan_flat   of another one, small enough to keep its tree

Rays begin over the bed: `down` into its lower half, within 20 degrees of the horizon, as a sidescan's; `up` from their
hits, 1 cm above, back to where they came from; `vertical` ones from there.
"""
import argparse
import statistics

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
import drjit as dr
import measuring
import mitsuba as mi
import numpy as np

from mitsonar.scene.loading import load_file, load_for_sonar, prepare
from mitsonar.scene.protocols import is_seabed
from mitsonar.scene.queries.height_field import HeightField, as_grid, mesh_arrays
from mitsonar.scene.queries.several_scenes import scene_of

SCENES = "sidescan_targets", "sidescan_wreck", "sidescan_dual"
ALTITUDE = 7.0                     # [m]
LIFT = 0.01                        # [m]


def main(argv=None):
    """Measure and print two tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scene", action="append", metavar="NAME", help="a shipped scene; repeatable")
    parser.add_argument("--rays", type=int, default=400_000)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args(argv)
    prepare()
    loads, rays = [], []
    for name in arguments.scene or SCENES:
        ways = {way: lambda load=load: load(name) for way, load in (("tree", load_file), ("none", load_for_sonar))}
        costs = measuring.rounds(ways, arguments.rounds)
        loads.append([name, *(f"{cpu(costs[way]):.2f}" for way in ways)])
        beds = [shape for shape in load_file(name).shapes() if is_seabed(shape)]
        bed = next((bed for bed in beds if as_grid(*mesh_arrays(bed)) is not None), None)
        if bed is None:
            parser.error(f"{name} has no bed that is a grid")
        rays += of_rays(name, bed, arguments)
    print(measuring.machine())
    measuring.table(["CPU seconds of loading", "with the tree", "without"], loads)
    print()
    measuring.table(["ns a ray", "triangles", "walked", "tree", "of the tree", "apart by 1 mm"], rays)


def of_rays(name, bed, arguments):
    """Rows of a table: what rays cost on a bed in both ways."""
    vertices, faces = mesh_arrays(bed)
    asked = {"walked": HeightField(as_grid(vertices, faces), 1), "tree": scene_of([bed])}
    generator, count = np.random.default_rng(1), arguments.rays
    low, high = vertices.min(0), vertices.max(0)
    start = generator.uniform(*(0.5 * (low + high) + part * (high - low) for part in (-0.1, 0.1)), (count, 3))
    start[:, 2] = high[2] + ALTITUDE
    azimuth, down = generator.uniform(0, 2 * np.pi, count), np.deg2rad(generator.uniform(3, 20, count))
    way = np.stack([np.cos(azimuth) * np.cos(down), np.sin(azimuth) * np.cos(down), -np.sin(down)])
    origin, direction = mi.Point3f(start.T.astype(np.float32)), mi.Vector3f(way.astype(np.float32))
    length = dr.minimum(asked["tree"].ray_intersect_preliminary(mi.Ray3f(origin, direction)).t, 100)
    place = dr.fma(length, direction, origin) + mi.Vector3f(0, 0, LIFT)
    dr.eval(origin, direction, place)
    rows = []
    for kind, ray in {"down": mi.Ray3f(origin, direction), "up": mi.Ray3f(place, -direction),
                      "vertical": mi.Ray3f(origin, mi.Vector3f(0, 0, -1))}.items():
        costs = measuring.rounds({side: lambda scene=scene, ray=ray: hits(scene, ray)
                                  for side, scene in asked.items()}, arguments.rounds)
        walked, tree = (1e9 / count * cpu(costs[side]) for side in asked)
        found = [hits(scene, ray).numpy() for scene in asked.values()]
        apart = np.mean(~(np.isclose(*found, rtol=0, atol=1e-3)))
        rows.append([f"{name}, {kind}", len(faces), f"{walked:.0f}", f"{tree:.0f}", f"{walked / tree:.2f}",
                     f"{apart:.1e}"])
    return rows


def cpu(cost):
    """Median of the CPU seconds of all threads."""
    return dr.thread_count() * statistics.median(cost.cpu)


def hits(scene, ray):
    """Distances of first hits."""
    found = scene.ray_intersect_preliminary(ray)
    dr.eval(found.t, found.prim_index, found.prim_uv)
    dr.sync_thread()
    return found.t


if __name__ == "__main__":
    main()
