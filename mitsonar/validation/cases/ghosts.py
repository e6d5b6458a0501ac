"""Ghosts of a point target reflected by a flat sea surface, in refracting water: time and level of every path."""
import numpy as np

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water.profile import SoundSpeedProfile

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table
from .rays import SUMMER

SONAR_DEPTH, TARGET = 10.0, (4.0, 30.0, -15.0)     # [m]
ABSORPTION, RATE = 0.030, 1e7                      # [dB/m], [1/s]
WATERS = {"uniform": SoundSpeedProfile.constant(1500.0), "summer": SUMMER}
STEP = 0.5 / RATE


def _ways(profile):
    """Yield name, time [s] and level [dB] of the echoes: direct, and with one or two reflections at the surface.

    A reflected ray is the direct ray in water mirrored about the surface; R = -1 at every bounce.
    """
    x, depth = float(np.hypot(*TARGET[:2])), -TARGET[2]
    mirrored = profile.mirrored()
    rays = eigenray(mirrored, SONAR_DEPTH, depth, x), eigenray(mirrored, -SONAR_DEPTH, depth, x)
    ratio = float(profile.at(depth) / profile.at(SONAR_DEPTH))
    for name, first, second, times in (("straight", 0, 0, 1), ("one way by the surface", 0, 1, 2),
                                       ("both ways by the surface", 1, 1, 1)):
        a, b = rays[first], rays[second]
        pressure = times * ratio / np.sqrt(a.spreading_area * b.spreading_area)
        loss = ABSORPTION * float(a.arc_length + b.arc_length)
        yield name, float(a.travel_time + b.travel_time), float(20 * np.log10(pressure)) - loss


def _run(quick):
    import mitsonar

    rows, panels = [], []
    for water, profile in WATERS.items():
        scene = scenes.array_sonar(
            {"bed": scenes.buried_bed(60.0), "sea": {"type": "sea_surface", "wind_speed": 0.0, "size": 400.0},
             "ball": scenes.point_target(TARGET)}, depth=SONAR_DEPTH,
            water={**scenes.water_of(profile), "absorption_db_per_km": 1e3 * ABSORPTION},
            film={"range": 50.0, "range_min": 25.0, "sample_rate_khz": RATE / 1e3},
            integrator={"max_depth": 3, "cell": 4.0, "rays": 64})
        response = mitsonar.impulse_response(scene, kernel="nearest")
        time, level = response["time"].values, 20 * np.log10(np.abs(response.values[0, 0, 0].astype(complex)) + 1e-30)
        ways = list(_ways(profile))
        for name, arrival, expected in ways:
            near = np.abs(time - arrival) < 20 / RATE
            k = np.flatnonzero(near)[np.argmax(level[near])]
            rows += [Compared(f"{water} water, {name}: time", 1e3 * float(time[k]), 1e3 * arrival, 1.01e3 * STEP, "ms"),
                     Compared(f"{water} water, {name}: level", float(level[k]), expected, 0.02, "dB")]
        shown = level > -150
        panels.append(Panel(f"{water} water", "two-way time [ms]", "response [dB re 1 m]", (
            Curve("chain", 1e3 * time[shown], level[shown], "."),
            *(Curve(name, [1e3 * arrival] * 2, [-150, expected]) for name, arrival, expected in ways))))
    return Table(tuple(rows), tuple(panels))


CASE = Case(title="Ghosts of a target by way of the surface", run=_run, text=(
    "A point target 15 m deep, 30 m from an element 10 m deep, under a flat surface, R = -1: echoes along the straight "
    "ray, by way of the surface once (there or back, two that coincide) and twice, time T_out + T_back and pressure "
    "(c_h/c₀)/√(A_out A_back) with the eigenrays of water unfolded about the surface. Every echo is in the nearest "
    "sample of 0.1 µs, so the allowed error of times is half of that; of levels it is 0.02 dB. The quick run is the "
    "same."))
