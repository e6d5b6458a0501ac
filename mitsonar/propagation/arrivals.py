"""The earliest arrival at a point, surely: aimed at on the device, looked for in NumPy where that may not be enough.

A direct ray, ray parameter p, meets each depth between its ends once. Any other ray to the same point turns above or
below both ends and covers the depths between as well, so that it is steeper there:

    1/f <= p_t = p - δ <= p,    y_t = sqrt(1 - p_t² c²) >= y          none if p f < 1

f the fastest water on the side where it turns, c no slower than any between the ends. There it falls short of the range
X by no more than D δ, for X(p) is convex and D its slope, nor by more than X (1 - p_t y / (p y_t)). Its turn must make
up for that, but takes 2 s_t / (p_t g) at least, g the steepest gradient there, s_t its sine at the end it goes on from,
where the speed is c_e: no less than y_t c_e / c. The direct ray is the only one, then, if with K = 2 / (p g)

    D δ < K s_t    up to some δ,    X (1 - y / (p f y_t)) < K (c_e / c) y_t    from there to p_t = 1/f

a parabola each (`alone`). For all other pairs the reference (`eigenrays`) tells, which misses no ray: of most pings
these are none, or the few that run nearly level through a thermocline. To it go direct rays that graze a level, too.
"""
from dataclasses import dataclass

import drjit as dr
import numpy as np

from .aiming import CLOSE_ENOUGH, aim
from .device import picked, upload
from .eigenrays import eigenray
from .two_point import MAX_TUBE_GAIN, to_hit

__all__ = ["Arrival", "alone", "earliest"]

JUST_TURNS = 1e-4              # of p f, which is 1 where a ray just turns: what aiming within CLOSE_ENOUGH leaves open
MARGIN = 0.99                  # of the range that a turn takes
GRAZING = 0.01                 # sine below which a ray carried over CLOSE_ENOUGH may err by nanoseconds
LARGEST_STEP = 0.1             # of p, which δ² is small up to


@dataclass(frozen=True, kw_only=True)
class Arrival:
    """Rays from sources to points, (R,) each.

    Attributes
    ----------
    found : Bool
    travel_time, ray_parameter : Float64 [s], [s/m]
    arc_length, spreading_area : Float [m], [m²/sr]
    launch_sine : Float64
        Positive down; of it the sign matters.
    arrival_sine : Float
    sound_speed : Float64 [m/s]
        At the point.
    """

    found: object
    travel_time: object
    arc_length: object
    spreading_area: object
    ray_parameter: object
    launch_sine: object
    arrival_sine: object
    sound_speed: object


def earliest(table, lib, source, fan, x, z, active):
    """Find the earliest direct or once-turned ray from sources to points; evaluates it.

    Parameters
    ----------
    table : LayerTable
    lib : Dr.Jit namespace
    source : SourceState or PointState
    fan : UInt32 (R,)
        Source of each ray.
    x, z : Float64 (R,) [m]
        Horizontal distance and depth of the points.
    active : Bool (R,)

    Returns
    -------
    Arrival
    """
    active &= dr.isfinite(x) & dr.isfinite(z)
    sine0, cosine0, found = aim(table, lib, source, fan, x, z, active)
    time, arc, area, p, sine, c = to_hit(table, lib, source, fan, sine0, cosine0, x, z, found,
                                         dr.opaque(lib.Float64, CLOSE_ENOUGH))
    z0, c0, _ = source.gather(lib, fan)
    found &= dr.isfinite(time) & dr.isfinite(p)
    unsure = active & ~(found & alone(table, z0, c0, sine0, x, z, c, sine, p, area))
    state = {"found": found, "travel_time": time, "arc_length": arc, "spreading_area": area, "ray_parameter": p,
             "launch_sine": sine0, "arrival_sine": sine, "sound_speed": c}
    dr.eval(state, unsure)
    some = dr.compress(unsure)
    if dr.width(some):
        count = max(map(dr.width, (unsure, *state.values())))
        index = dr.arange(lib.UInt32, count)
        z0, x, z = (picked(value, some).numpy() for value in (z0, x, z))
        state = {name: picked(value, index) for name, value in state.items()}
        for name, value in _looked_for(table.profile, z0, z, x).items():
            kind = type(state[name])
            dr.scatter(state[name], upload(kind, value.astype(dr.zeros(kind, 1).numpy().dtype)), some)
    return Arrival(**state)


def alone(table, z0, c0, sine0, x, z, c, sine, p, area):
    """Tell of rays found whether they are surely direct and the only ones to their points, Bool (R,).

    Parameters
    ----------
    table : LayerTable
    z0, c0, sine0 : Float64 (R,) [m], [m/s], [-]
        Depth, sound speed and sine at the source, positive down.
    x, z : Float64 (R,) [m]
        Horizontal distance and depth of the point.
    c, sine : Float64, Float (R,) [m/s], [-]
        At the point.
    p : Float64 (R,) [s/m]
    area : Float (R,) [m²/sr]
        The ray's spreading.
    """
    kind = type(p)
    up = z < z0
    high, low = dr.select(up, z, z0), dr.select(up, z0, z)
    fastest = dr.maximum(c0, c)
    above, steep_above, below_high, _ = table.turns(high)
    above_low, _, below, steep_below = table.turns(low)
    turns_above = (above > fastest) & (p * above > 1 - JUST_TURNS)
    turns_below = (below > fastest) & (p * below > 1 - JUST_TURNS)
    # it does not turn itself, unless it turns on either side
    direct = ((sine0 < 0) == up) & ((sine < 0) == up) & ~(turns_above & turns_below)
    end = dr.select(turns_above == up, c, c0)
    limit, steepest = dr.select(turns_above, above, below), dr.select(turns_above, steep_above, steep_below)
    turn = MARGIN * 2 / (p * steepest)
    sines = dr.sqrt(dr.maximum((1 - p * p * c0 * c0) * (1 - p * p * c * c), 0))
    slope = kind(area) * c0 * c0 * p / dr.maximum(x * sines, 1e-12)
    # as far as the slope tells: D² δ² = K² (s² + c_e² (2 p - δ) δ), of the bracket's δ the largest
    share = dr.square(turn / slope)
    linear = (1 - 0.5 * LARGEST_STEP) * end * end * p * share
    far = dr.minimum(linear + dr.sqrt(linear * linear + share * dr.maximum(1 - p * p * end * end, 0)), LARGEST_STEP * p)
    # what lies between lies above the one end and below the other
    fastest = dr.maximum(fastest, dr.minimum(above_low, below_high))
    sine, least, steeper = (dr.sqrt(dr.maximum(1 - dr.square(part * fastest), 0)) for part in (p, p - far, 1 / limit))
    turn *= end / fastest
    worst = dr.minimum(dr.maximum(0.5 * x / turn, least), steeper)
    only = (least >= steeper) | (turn * worst * worst - x * worst + x * sine / (p * limit) > 0)
    grazes = (sine < GRAZING) & ((c != c0) | (dr.maximum(steep_above, steep_below) > 0))
    return (~(turns_above | turns_below) | (direct & only)) & ~grazes


def _looked_for(profile, source_depth, depth, distance):
    """Fields of an `Arrival`, from the reference."""
    ray = eigenray(profile, source_depth, depth, distance)
    found = ray.exists
    area = np.maximum(ray.spreading_area, (distance ** 2 + (depth - source_depth) ** 2) / MAX_TUBE_GAIN)
    return {"found": found, "travel_time": ray.travel_time, "arc_length": ray.arc_length, "spreading_area": area,
            "ray_parameter": ray.ray_parameter, "launch_sine": np.sin(ray.launch_angle),
            "arrival_sine": np.sin(ray.arrival_angle), "sound_speed": profile.at(depth)}
