"""The earliest arrival at a point, surely: aimed at on the device, looked for in NumPy where that may not be enough.

A direct ray, ray parameter p, meets each depth between its ends once. Any other ray to the same point turns above or
below both ends, covers the depths between as well, and is therefore steeper there:

    p_t <= p,    p_t >= 1 / f            f the fastest water it can turn in; none if p f < 1

It goes up to its turning point and back by no less than 2 s_t / (p g), g the steepest gradient there, s_t its sine at
the near end, which the direct ray, X(p) being convex, must fall short by: with δ = p - p_t and D = dX/dp

    D δ >= 2 / (p g) sqrt(s² + c² (2 p δ - δ²))        where p_t meets the point

The right side is concave in δ and larger at 0; where it is larger at δ = p - 1/f, too, the direct ray is the only one
(`alone`). For all other pairs the reference (`eigenrays`) tells, which misses no ray: of most pings none, or the few
that run nearly level through a thermocline.
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
    (above, steep_above), (below, steep_below) = table.turning_above(high), table.turning_below(low)
    turns_above = (above > fastest) & (p * above > 1 - JUST_TURNS)
    turns_below = (below > fastest) & (p * below > 1 - JUST_TURNS)
    # it does not turn itself, unless it turns on either side
    direct = ((sine0 < 0) == up) & ((sine < 0) == up) & ~(turns_above & turns_below)
    end = dr.select(turns_above == up, c, c0)
    limit, steepest = dr.select(turns_above, above, below), dr.select(turns_above, steep_above, steep_below)
    further = dr.maximum(p - dr.rcp(limit), 0)
    sine_there = 1 - p * p * end * end
    sines = dr.sqrt(dr.maximum((1 - p * p * c0 * c0) * (1 - p * p * c * c), 0))
    slope = kind(area) * c0 * c0 * p / dr.maximum(x * sines, 1e-12)
    turn = 2 * dr.sqrt(dr.maximum(sine_there + end * end * further * (2 * p - further), 0)) / (p * steepest)
    return ~(turns_above | turns_below) | (direct & (slope * further < MARGIN * turn))


def _looked_for(profile, source_depth, depth, distance):
    """Fields of an `Arrival`, from the reference."""
    ray = eigenray(profile, source_depth, depth, distance)
    found = ray.exists
    area = np.maximum(ray.spreading_area, (distance ** 2 + (depth - source_depth) ** 2) / MAX_TUBE_GAIN)
    return {"found": found, "travel_time": ray.travel_time, "arc_length": ray.arc_length, "spreading_area": area,
            "ray_parameter": ray.ray_parameter, "launch_sine": np.sin(ray.launch_angle),
            "arrival_sine": np.sin(ray.arrival_angle), "sound_speed": profile.at(depth)}
