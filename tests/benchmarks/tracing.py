"""What refraction costs: bent rays against straight ones on the same seabed, in one run.

    python tests/benchmarks/tracing.py [--cast FILE]

Two questions, each against the best that Mitsuba offers for straight rays:

- hits alone: which triangle, and where on it, against `Scene.ray_intersect_preliminary`; aim 0.85 of its rate;
- hits with what a sonar needs (point, normal, travel time, spreading, angles at both ends, in float64) against
  `Scene.ray_intersect` with point and normal; aim 0.70 of its rate.

Both straight calls are coherent and minimal. The source stands 20 m above a bed of about two million triangles and
looks all the way round, at grazing angles from 5 to 90 degrees; neighbouring rays come in 4 x 4 tiles, as the renderer
sends them.
"""
import argparse

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
import drjit as dr
import measuring
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.io import casts
from mitsonar.scene.loading import prepare
from mitsonar.scene.tracing.tracer import Tracer, _first_hit, angles
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

SOURCE_DEPTH, STEEPEST_DEG, TILE = 20.0, 90.0, 4
HITS, WHOLE = "ray_intersect_preliminary, straight", "ray_intersect, straight"


def main(argv=None):
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cast", default=measuring.SUMMER, help="sound-speed cast; default: scenes/casts/summer.csv")
    parser.add_argument("--rays", type=int, default=1 << 20)
    parser.add_argument("--nodes", type=int, default=1000, help="of the seabed, along a side; default 1000")
    parser.add_argument("--flattest", type=float, default=5.0, help="least grazing angle [degrees]; default 5")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args(argv)
    prepare()
    cast = casts.read(arguments.cast)
    scene = mi.load_dict({"type": "scene", "bed": measuring.seabed(arguments.nodes)})
    direction, rays = directions(arguments.rays, arguments.flattest)
    candidates = straight(scene, direction)
    for name, profile in (("constant speed", SoundSpeedProfile.constant(1500.0)), ("cast", cast.profile)):
        candidates.update(refracted(scene, direction, name, profile))
    cost = measuring.rounds(candidates, arguments.rounds, warm_up=2)
    print(measuring.machine())
    print(f"{measuring.triangles(scene):,} triangles, {rays:,} rays from {SOURCE_DEPTH:g} m above the bed at "
          f"{arguments.flattest:g} to {STEEPEST_DEG:g} degrees; cast: {cast.format}, {cast.profile.depth.size} nodes, "
          f"{cast.profile.sound_speed.min():.1f} to {cast.profile.sound_speed.max():.1f} m/s; medians of "
          f"{arguments.rounds} rounds\n")
    rows = []
    for name, seconds in cost.items():
        against = HITS if "hits alone" in name else WHOLE
        of_it = [f"{np.median(clock_of_it / clock):.2f}" if name not in (HITS, WHOLE) else ""
                 for clock, clock_of_it in zip(seconds, cost[against])]
        rates = [f"{rays / np.median(clock) / 1e6:.1f}" for clock in seconds]
        rows.append([name, *rates, *of_it, "" if name in (HITS, WHOLE) else against.partition(",")[0]])
    measuring.table(["", "wall M rays/s", "CPU-normalised", "wall ratio", "CPU ratio", "to the rate of"], rows)


def directions(rays, flattest_deg):
    """Return unit directions and their number: a grid over azimuth and grazing angle, in tiles."""
    side = max(TILE, TILE * round(np.sqrt(rays) / TILE))
    place = (np.arange(side) + 0.5) / side
    azimuth, grazing = np.meshgrid(2 * np.pi * place, np.radians(flattest_deg + (STEEPEST_DEG - flattest_deg) * place))
    order = np.arange(side * side).reshape(side // TILE, TILE, side // TILE, TILE).transpose(0, 2, 1, 3).ravel()
    azimuth, grazing = azimuth.ravel()[order], grazing.ravel()[order]
    parts = np.cos(grazing) * np.cos(azimuth), np.cos(grazing) * np.sin(azimuth), -np.sin(grazing)
    direction = mi.Vector3f(*(mi.Float(part.astype(np.float32)) for part in parts))
    dr.eval(direction)
    return direction, side * side


def straight(scene, direction):
    """Return the two straight candidates."""
    origin = mi.Point3f(0, 0, -SOURCE_DEPTH)
    dr.make_opaque(origin)

    def hits():
        pi = scene.ray_intersect_preliminary(mi.Ray3f(origin, direction), coherent=True)
        finish(pi.t, pi.prim_index, pi.prim_uv)

    def whole():
        si = scene.ray_intersect(mi.Ray3f(origin, direction), ray_flags=mi.RayFlags.Minimal, coherent=True)
        finish(si.t, si.p, si.n)

    return {HITS: hits, WHOLE: whole}


def refracted(scene, direction, name, profile):
    """Return the candidates of one profile: hits alone, hits with what a sonar needs, and all that a hit tells."""
    lib = arrays_of(mi.Float)
    tracer = Tracer(scene, DeviceWater(profile), max_range=300.0)
    sources = tracer.sources(SOURCE_DEPTH)
    origin = lib.Array3f64(0, 0, -SOURCE_DEPTH)
    dr.make_opaque(origin)
    source = dr.opaque(mi.UInt32, 0)

    def hits():
        launch_angle, heading = angles(direction)
        start = mi.Point3f(origin)
        valid, pi, *_ = _first_hit(scene, sources.ray_fans, start, source, launch_angle, heading, mi.Bool(True))
        finish(valid, pi.t, pi.prim_index, pi.prim_uv)

    def whole():
        found = tracer.trace(sources, origin, source, direction)
        finish(found.valid, found.point, found.normal, found.travel_time, found.spreading_area,
               found.launch_direction, found.arrival_direction)

    def everything():
        found = tracer.trace(sources, origin, source, direction)
        finish(*vars(found).values())

    return {f"{name}: hits alone": hits, f"{name}: point, normal, time, spreading, angles": whole,
            f"{name}: all of these, arc length, label, ...": everything}


def finish(*arrays):
    """Have arrays computed, and wait for it."""
    dr.eval(*arrays)
    dr.sync_thread()


if __name__ == "__main__":
    main()
