"""How exact the return times to an array's elements are, and what they cost.

    python tests/benchmarks/return_times.py [--reference FILE.json] [--casts FOLDER]

First table: errors against the exact eigenray in nanoseconds, rms / largest, of elements a distance off a still centre,
above and below, ahead and behind, and to the sides; hits at ranges from 20 to 200 m, 3 m or more below the sonar:

    paper     equation 2 with the coefficient 0.503
    GVA2      effective speed to second order in the element's offset, from p, D = dX/dp and dc/dz at the origin
    moments   series in the mean and three central moments of 1/c², calibrated on the traced time
    vector    the vector approximation, without its guard
              these over direct rays that leave the sonar steeper than 5 degrees;
    guarded   `mitsonar.propagation.return_time`, over all rays, and which share of its times are eigenrays

of which GVA2 and moments are here alone, for the choice. Second table: the same over all profiles, by direction. Third:
differences per second on the device, float32, and of `return_time` in NumPy.

A reference is a JSON file {"profiles": {name: {"depth": [...], "c": [...]}}}; casts are what `io.casts` reads.
"""
import argparse
import json
import time
from pathlib import Path

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
import drjit as dr
import measuring
import numpy as np
from drjit.auto import Float, Float64, UInt32

from mitsonar.device.arrays import upload
from mitsonar.io import casts
from mitsonar.propagation import eigenray, return_time, return_time_error
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.numpy_rays.return_times import GUARD, approximate, leg_integrals
from mitsonar.propagation.returns.vector_approximation import DIFFERENCES, ELEMENT_FIELDS
from mitsonar.water import SoundSpeedProfile

OFFSETS = 0.1, 0.5, 1.0            # [m]
METHODS = "paper", "GVA2", "moments", "vector", "guarded"
NEAREST, FARTHEST = 20.0, 200.0    # [m]
SHALLOWEST, HIGHEST = 3.0, 45.0    # [m] hits below the sonar
FLAT = np.deg2rad(5)
LANES, ELEMENTS = 1 << 17, 32


def main(argv=None):
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--reference", metavar="FILE.json", help="profiles; default: closed-form ones")
    parser.add_argument("--casts", metavar="FOLDER", help="real casts besides scenes/casts/summer.csv")
    parser.add_argument("--hits", type=int, default=2000, help="per profile; default 2000")
    parser.add_argument("--lanes", type=int, default=LANES, help="hits of the third table")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args(argv)
    print(measuring.machine(), "\n")
    errors = {name: measured(profile, arguments.hits) for name, profile in profiles(arguments).items()}
    for offset in OFFSETS:
        print(f"\nelements {offset:g} m off, error [ns], rms / largest\n")
        markdown(["profile", *METHODS, "by eigenray"],
                 [[name, *(figures(found[offset][method]) for method in METHODS), f"{found[offset]['share']:.1%}"]
                  for name, found in errors.items()])
    print("\nall profiles, error [ns], rms / largest\n")
    markdown(["method", "direction", *(f"{offset:g} m" for offset in OFFSETS)], [
        [method, direction, *(figures(np.concatenate([found[offset][method][:, part] for found in errors.values()]))
                              for offset in OFFSETS)]
        for method in METHODS for direction, part in DIRECTIONS.items()])
    print(f"\ndifferences, {arguments.lanes} hits x {ELEMENTS} elements\n")
    markdown(["method", "million per second"], rates(arguments))


# -------------------------------------------------------------------------------------------------------- profiles

def profiles(arguments):
    """Return the profiles by name."""
    depth = np.arange(0.0, 61.0)
    found = {"constant": SoundSpeedProfile([0, 60], [1500, 1500]),
             "gradient 0.1 1/s": SoundSpeedProfile([0, 60], [1500, 1506]),
             "gradient -1 1/s": SoundSpeedProfile([0, 60], [1560, 1500]),
             "thermocline": SoundSpeedProfile(depth, 1490 + 9 * (1 - np.tanh((depth - 15) / 4)))}
    if arguments.reference:
        nodes = json.loads(Path(arguments.reference).read_text(encoding="utf-8"))["profiles"]
        found = {name: SoundSpeedProfile(entry["depth"], entry["c"]) for name, entry in nodes.items()}
    found["cast summer"] = casts.read(measuring.SUMMER).profile
    for path in sorted(Path(arguments.casts).iterdir()) if arguments.casts else ():
        try:
            found[f"cast {path.stem}"] = casts.read(path).profile
        except ValueError as error:
            print(f"left out: {error}")
    return found


def figures(error):
    """Print rms and largest of errors [s], in ns."""
    error = np.abs(error[np.isfinite(error)]) * 1e9
    return f"{np.sqrt(np.mean(error**2)):.2g} / {error.max():.2g}" if error.size else "-"


def markdown(header, rows):
    """Print a Markdown table."""
    for row in (header, ["---"] * len(header), *rows):
        print("| " + " | ".join(map(str, row)) + " |", flush=True)


# ---------------------------------------------------------------------------------------------------------- errors

SIGNS = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
DIRECTIONS = {"vertical": slice(0, 2), "horizontal": slice(2, 4), "cross": slice(4, 6)}


def measured(profile, count):
    """Return the errors (H, 6) of each method at each offset, and the share of times that are eigenrays."""
    rng = np.random.default_rng(1)
    bottom = max(min(profile.depth[-1], 120.0), 10.0)
    depth = 0.2 * bottom
    below = rng.uniform(min(SHALLOWEST, 0.5 * (bottom - depth)), min(HIGHEST, bottom - depth), count)
    distance = np.exp(rng.uniform(np.log(NEAREST), np.log(FARTHEST), count))
    across = np.sqrt(np.maximum(distance**2 - below**2, 0))
    hits = np.stack([across, np.zeros(count), -depth - below], -1)
    found = {}
    for offset in OFFSETS:
        geometry = profile, [0, 0, -depth], hits, offset * SIGNS
        exact = return_time(*geometry, method="eigenray")
        times = {"paper": return_time(*geometry, method="paper"), "guarded": return_time(*geometry)}
        trusted = return_time_error(*geometry)
        times["vector"], times["GVA2"], times["moments"], steep = others(profile, depth, hits, offset * SIGNS)
        found[offset] = {name: (values - exact) * (1 if name == "guarded" else steep) for name, values in times.items()}
        found[offset]["share"] = np.mean((trusted > GUARD)[np.isfinite(exact)])
    return found


def others(profile, depth, hits, elements):
    """Vector without guard, GVA2 and moments (H, E), and the rays that turned or leave within `FLAT` as NaN (H,)."""
    origin = np.array([0, 0, -depth])
    ray = eigenray(profile, depth, -hits[:, 2], hits[:, 0])
    steep = np.where(np.isnan(ray.turning_depth) & (np.abs(ray.launch_angle) > FLAT), 1.0, np.nan)
    p = np.where(np.isfinite(steep), ray.ray_parameter, 0)
    with np.errstate(all="ignore"):
        vector = approximate(profile, origin, hits - origin, elements, np.zeros(3))[1]
        first, second, *_ = leg_integrals(profile, depth, -hits[:, 2], p)
        second_order = gva2(profile, depth, hits, elements, ray.travel_time, p, first + p**2 * second)
        series = moments(profile, depth, hits, elements) - moments(profile, depth, hits, np.zeros((1, 3)))
    return vector, second_order, ray.travel_time[:, None] + series, steep[:, None]


def gva2(profile, depth, hits, elements, time, p, slope):
    """Effective speed to second order in the offset, in axes (away from the hit, up, aside); the hits lie along x."""
    x, h, speed = hits[:, 0], -hits[:, 2] - depth, profile.at(depth)
    q = np.sqrt(1 / speed**2 - p**2)
    distance = np.hypot(x, h)
    unit = np.stack([x / distance, h / distance, 0 * x], -1)
    first = np.stack([p, q, 0 * p], -1)
    effective = distance / time
    times = np.empty((len(hits), len(elements)))
    for k, (along, aside, up) in enumerate(elements):
        gradient = -profile.gradient(depth, "above" if up > 0 else "below")
        second = np.zeros((len(hits), 3, 3))
        second[:, 0, 0], second[:, 2, 2] = 1 / slope, p / x
        second[:, 0, 1] = second[:, 1, 0] = -p / (q * slope)
        second[:, 1, 1] = p**2 / (q**2 * slope) - gradient / (speed**3 * q)
        bending = (np.eye(3) - unit[:, :, None] * unit[:, None]) / distance[:, None, None]
        e = (unit - effective[:, None] * first) / time[:, None]
        cross = e[:, :, None] * first[:, None]
        e2 = (bending - effective[:, None, None] * second - cross - cross.transpose(0, 2, 1)) / time[:, None, None]
        a = np.array([-along, up, aside])
        speed_there = effective + e @ a + 0.5 * np.einsum("i,hij,j->h", a, e2, a)
        times[:, k] = np.sqrt((x - along) ** 2 + (h + up) ** 2 + aside**2) / speed_there
    return times


def moments(profile, depth, hits, elements):
    """Travel time by the series in four moments of 1/c² between the two depths."""
    table = layer_table(profile, Float)
    reference = float(table.reference.numpy()[0])

    def sums(z):
        return np.array([part.numpy() for part in table.at(upload(Float64, np.ravel(z)))[1]])

    above, below = sums(depth - elements[:, 2])[:, None], sums(-hits[:, 2])[:, :, None]
    height = -hits[:, 2][:, None] - depth + elements[:, 2]
    x = np.hypot(hits[:, 0][:, None] - elements[:, 0], elements[:, 1])
    n1, n2, n3, n4 = (below - above) / height
    m2, m3 = n2 - n1**2, n3 - 3 * n1 * n2 + 2 * n1**3
    m4 = n4 - 4 * n1 * n3 + 6 * n1**2 * n2 - 3 * n1**4
    square, y = 1 + n1, x / height
    t = (1 + y * y) / square
    y = y / (1 + 3 / 8 * m2 * t**2 - 5 / 16 * m3 * t**3)
    q2 = square / (1 + y * y)
    q = np.sqrt(q2)
    series = 1 - m2 / (8 * q2**2) + m3 / (16 * q2**3) - 5 * m4 / (128 * q2**4)
    return np.sqrt(reference) * (y * q * x + height * q * series)


# ------------------------------------------------------------------------------------------------------------ rates

def rates(arguments):
    """Rows of the third table."""
    rng = np.random.default_rng(2)
    lanes, profile = arguments.lanes, casts.read(measuring.SUMMER).profile
    elements = rng.uniform(-0.5, 0.5, (ELEMENTS, 3))
    # plausible fields; what they hold does not change the work
    hits = [upload(Float, np.float32(np.full(lanes, value) + 1e-4 * rng.random(lanes))) for value in
            (0.6, 0.3, 0.74, 0, 0, 1, 0.01, 1495, 1494, 2.2e6, 0.74, 0.01, 0.01, 0, 0.1, 0.02, 0.01, 0)]
    difference = {"straight, one speed": lambda h, e: (h[0] * e[0] + h[1] * e[1] + h[2] * e[2]) / h[7], **DIFFERENCES}
    work = {}
    for name, function in difference.items():
        fields = ELEMENT_FIELDS.get(name, ELEMENT_FIELDS["vector"])(elements, 10.0, profile)
        fields = [upload(Float, np.float32(field)) for field in fields]
        dr.eval(hits, fields)
        work[name] = lambda function=function, fields=fields: dr.sync_thread() if dr.eval(
            summed(function, hits, fields)) else dr.sync_thread()
    rows = [[f"{name}, float32 on the device", f"{lanes * ELEMENTS / np.median(cost.cpu) / 1e6:.0f}"]
            for name, cost in measuring.rounds(work, arguments.rounds).items()]
    scene = rng.uniform([20, -100, -40], [100, 100, -30], (max(1, lanes // 8), 3))
    for name in ("paper", "vector", "eigenray"):
        start = time.perf_counter()
        return_time(profile, [0, 0, -10], scene, elements[:4], (2, 0, 0), name)
        rows.append([f"{name}, return_time, under way", f"{len(scene) * 4 / (time.perf_counter() - start) / 1e6:.2f}"])
    return rows


@dr.syntax
def summed(function, hits, fields):
    """The sum of the differences of all elements to each hit, in one kernel."""
    total, k, last = Float(0), UInt32(0), dr.opaque(UInt32, ELEMENTS)
    while k < last:
        total += function(hits, [dr.gather(Float, field, k) for field in fields])
        k += 1
    return total


if __name__ == "__main__":
    main()
