"""How exact times, lengths and spreading are: eigenrays against a reference, traced hits against eigenrays.

    python tests/benchmarks/eigenrays.py [--reference FILE.json]

First table: `mitsonar.propagation.numpy_rays.eigenrays` against known rays; the worst error over the cases of a
profile, and how many of the cases were found. Without a reference these are water of one sound speed and of one
gradient, by the closed forms of a circular arc,

    t = (2/g) asinh(g d / (2 sqrt(c1 c2))),    A = (c2 sinh(g t) / g)^2,    X, z the offsets, d^2 = X^2 + z^2

A reference is a JSON file of the form {"profiles": {name: {"depth": [...], "c": [...]}}, "cases": [{"profile",
"source_depth", "target_depth", "range", "time", "arc_length", "launch_angle", "spreading_m2_per_sr"}]}, numbers or
decimal text, SI and radians.

Second table: rays traced to a rough seabed at ranges to 260 m, half of them within 12 degrees of the horizon, against
the eigenray to the very point that was hit. The seabed is 45 m deep, the sources 10.3 and 20 m.
"""
import argparse
import json

import measuring
import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.io import casts
from mitsonar.propagation.numpy_rays.eigenrays import eigenrays
from mitsonar.scene.loading import prepare
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

FIELDS = "time", "arc_length", "launch_angle", "spreading_m2_per_sr"
SOURCE_DEPTHS, FARTHEST = (10.3, 20.0), 260.0


def main(argv=None):
    """Measure and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--reference", metavar="FILE.json", help="known eigenrays; default: closed forms")
    parser.add_argument("--cast", default=measuring.SUMMER, help="one more profile; default: scenes/casts/summer.csv")
    parser.add_argument("--rays", type=int, default=20_000, help="traced per profile and source depth")
    parser.add_argument("--nodes", type=int, default=1200, help="of the seabed, along a side; default 1200")
    arguments = parser.parse_args(argv)
    prepare()
    print(measuring.machine(), "\n")
    profiles, cases = closed_forms() if arguments.reference is None else reference(arguments.reference)
    print("eigenrays against", arguments.reference or "closed forms", "(worst of each profile)\n")
    measuring.table(["profile", "cases", "found", "time [s]", "arc length [m]", "launch [rad]", "spreading"],
                    [solver_row(name, profile, cases[name]) for name, profile in profiles.items()])
    profiles["cast"] = casts.read(arguments.cast).profile
    scene = mi.load_dict({"type": "scene", "bed": measuring.seabed(arguments.nodes)})
    print(f"\ntraced hits against the eigenray to the same point, ranges to {FARTHEST:g} m\n")
    measuring.table(["profile", "hits", "turned", "time [s]: median", "99.9 %", "worst", "above 1 ns",
                     "arc [m]: worst", "spreading: median", "99 %", "worst"],
                    [traced_row(scene, name, profile, arguments.rays) for name, profile in profiles.items()])


def reference(path):
    """Return the profiles and the cases (N, time, ...) of each, from a file."""
    with open(path, encoding="utf-8") as file:
        content = json.load(file)
    profiles = {name: SoundSpeedProfile(entry["depth"], entry["c"]) for name, entry in content["profiles"].items()}
    columns = "source_depth", "target_depth", "range", *FIELDS
    cases = {name: [[float(case[column]) for column in columns] for case in content["cases"] if case["profile"] == name]
             for name in profiles}
    return profiles, {name: np.array(rows) for name, rows in cases.items()}


def closed_forms():
    """The same for water of one sound speed and of one gradient."""
    profiles, cases = {}, {}
    z0, z1, x = (a.ravel() for a in np.meshgrid([5.0, 60.0], [35.0, 100.0, 180.0], [1.0, 30.0, 100.0, 250.0]))
    for g in (0.0, 0.1, -0.1, 1.0, -1.0):
        name = f"gradient {g:+g} 1/s" if g else "constant"
        profiles[name] = SoundSpeedProfile([0.0, 200.0], [1500.0, 1500.0 + 200 * g])
        c0, c1 = 1500 + g * z0, 1500 + g * z1
        d = np.hypot(x, z1 - z0)
        if g:
            time = 2 / abs(g) * np.arcsinh(abs(g) * d / (2 * np.sqrt(c0 * c1)))
            area = (c1 * np.sinh(g * time) / g) ** 2
            # the arc's centre lies where c would be zero, this far from the source
            centre = (c1**2 - c0**2 + g**2 * x**2) / (2 * g**2 * x)
            angle, radius = np.arctan(centre * g / c0), np.hypot(centre, c0 / g)
            length = 2 * radius * np.arcsin(d / (2 * radius))
        else:
            time, area, angle, length = d / 1500, d**2, np.arctan2(z1 - z0, x), d
        cases[name] = np.stack([z0, z1, x, time, length, angle, area], -1)
    return profiles, cases


def solver_row(name, profile, cases):
    """The worst errors over one profile's cases, each against the arrival nearest in angle."""
    source, target, x, time, length, launch, area = cases.T
    found = eigenrays(profile, source, target, x)
    far = np.where(found.exists, np.abs(found.launch_angle - launch[:, None]), np.inf)
    which = (np.arange(len(cases)), far.argmin(-1))
    there = far[which] < 1e-6
    errors = [found.travel_time[which] - time, found.arc_length[which] - length, found.launch_angle[which] - launch,
              found.spreading_area[which] / area - 1]
    return [name, len(cases), int(there.sum()), *(f"{np.abs(error[there]).max():.0e}" for error in errors)]


def traced_row(scene, name, profile, rays):
    """Errors of traced hits: time, arc length, spreading (relative)."""
    lib, errors, turned, hits = arrays_of(mi.Float), [], 0, 0
    direction = slanting(rays)
    tracer = Tracer(scene, DeviceWater(profile), max_range=FARTHEST)
    for depth in SOURCE_DEPTHS:
        found = tracer.trace(tracer.sources(depth), lib.Array3f64(0, 0, -depth), mi.UInt32(0), direction)
        valid = found.valid.numpy()
        x, y, z = found.point.numpy()[:, valid]
        time, length, area = (getattr(found, field).numpy()[valid] for field in
                              ("travel_time", "arc_length", "spreading_area"))
        exact = eigenrays(profile, depth, -z, np.hypot(x, y))
        # of several arrivals, the one that was traced has this time and direction
        launch = -np.arcsin(np.clip(found.launch_direction.numpy()[2, valid], -1, 1))
        far = np.abs(exact.travel_time - time[:, None]) / 1e-6 + np.abs(exact.launch_angle - launch[:, None]) / 1e-3
        which = (np.arange(time.size), np.nanargmin(far, -1))
        errors.append(np.abs([exact.travel_time[which] - time, exact.arc_length[which] - length,
                              area / exact.spreading_area[which] - 1]))
        turned += np.isfinite(exact.turning_depth[which]).sum()
        hits += time.size
    time, length, area = np.concatenate(errors, axis=1)
    return [name, hits, f"{turned / hits:.1%}", f"{np.median(time):.0e}", f"{np.quantile(time, 0.999):.0e}",
            f"{time.max():.0e}", int((time > 1e-9).sum()), f"{length.max():.0e}", f"{np.median(area):.0e}",
            f"{np.quantile(area, 0.99):.0e}", f"{area.max():.0e}"]


def slanting(rays):
    """Directions of rays: half at 5 to 90 degrees down, half from 3 up to 12 down, the same ones every time."""
    generator = np.random.default_rng(1)
    azimuth = generator.uniform(0, 2 * np.pi, rays)
    steep, flat = generator.uniform(5, 90, rays - rays // 2), generator.uniform(-3, 12, rays // 2)
    down = np.radians(np.concatenate([steep, flat]))
    parts = np.cos(down) * np.cos(azimuth), np.cos(down) * np.sin(azimuth), -np.sin(down)
    return mi.Vector3f(*(mi.Float(part.astype(np.float32)) for part in parts))


if __name__ == "__main__":
    main()
