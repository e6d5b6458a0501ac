"""The vector approximation: return times to all elements of an array from the one ray that was traced.

The leg from the hit to the origin O of its ray is replaced by a straight vector in water of one speed. The vector is
the ray of a homogeneous layer that has the leg's ray parameter p and, with s = 1/c² - p² and integrals over depth,

    Y = X/p = ∫ s^(-1/2) dz,    E = ∫ s^(-3/2) dz,    D = dX/dp = Y + p² E
    c_m² = E / D,    u = sqrt(Y / E),    R = Y / c_m,    n = c_m (p, u)

so range, slope and curvature of the wavefront at O are the ray's own: a virtual point at the same bearing, distance R.
An element at d from where the array's centre is when its own echo arrives then hears the hit later by

    q = 2 n·d + |d|²/R,   B = c_m - n·v - v·d/R,   δ = q / (B + sqrt(B² + (c_m² - |v|²) q/R))

which solves |R n + d + v δ| = R + c_m δ for the platform's velocity v, in a form that loses nothing to cancellation.
Three corrections follow, w the vertical cosine at the element, ε = c_m² <1/c²> - 1 and V the variance of c_m²/c² in the
slice of water, h thick, between the centre and the element, Q = sqrt(w² + ε):

    slice          h ε / (w + Q) - h V / (8 Q³)                     the element's own water instead of the leg's
    bending        dX a/2 (1 - a p c_m/w²),  a = dX/D               the ray's change of p (Newton), dX its miss
    third order    -γ (Δp c_m)³,  γ = p³ (G - E²/Y) / (2 c_m²)      G = ∫ s^(-5/2) dz, Δp = p at the element - p

all in metres of c_m, divided by B. By reciprocity the same with v = 0 gives the delays of transmit elements.

The published formula (`paper_difference`) keeps the vector itself, R the distance, and takes the speed along it as
ev + 0.503 g Δheight (equation 2), g the mean gradient between the two heights.

Everything is written once for NumPy (float64) and Dr.Jit (float32). Fields are in scene coordinates, z up.
"""
from typing import NamedTuple

import drjit as dr
import numpy as np

from .slices import Slices

__all__ = ["COEFFICIENT", "DIFFERENCES", "Leg", "centre_return", "ELEMENT_FIELDS", "hit_fields", "matched_leg",
           "paper_centre_return", "paper_difference", "paper_element_fields", "vector_difference",
           "vector_element_fields"]

COEFFICIENT = 0.503        # of equation 2, as published
LEVEL = 1e-4               # vertical cosines are kept above this; such rays are not for this method


class Leg(NamedTuple):
    """The equivalent straight vector of a leg, every field (H,)."""

    length: object           # R [m]
    speed: object            # c_m [m/s]
    horizontal: object       # p c_m, the sine of the angle from the vertical [-]
    vertical: object         # u c_m, positive: away from the hit is away from its depth [-]
    third: object            # γ [m]


def _library(array):
    return np if isinstance(array, (np.ndarray, float)) else dr


def _select(condition, yes, no):
    return np.where(condition, yes, no) if isinstance(condition, (np.ndarray, np.bool_)) else dr.select(
        condition, yes, no)


# ------------------------------------------------------------------------------------------------- shared kernels

def _straight(along, square, inverse_length, speed, closing, speeds):
    """δ [s] of the closed quadratic; ``along`` n·d, ``square`` |d|², ``closing`` B, ``speeds`` c² - v²."""
    q = 2 * along + inverse_length * square
    return q / (closing + _library(q).sqrt(closing * closing + speeds * inverse_length * q))


def _corrections(leg_vertical, leg_horizontal, third, inverse_length, lengthening, height, excess, variance):
    """Slice, bending and third order [m]; ``height`` away from the hit, ``lengthening`` c_m δ, ``excess`` ε."""
    xp = _library(leg_vertical)
    stretch = 1 + inverse_length * lengthening
    w = xp.maximum((leg_vertical + inverse_length * height) / stretch, LEVEL)
    square = w * w
    p = xp.sqrt(xp.maximum(1 - square, 0))
    squared_root = xp.maximum(square + excess, LEVEL**2)
    root = xp.sqrt(squared_root)
    first = excess / (w + root)
    miss = height * p * first / (w * root)
    slope = stretch / (inverse_length * square) + height * (
        (1 + excess) / (squared_root * root) - 1 / (square * w))
    bend = miss / slope
    change = p + bend - leg_horizontal
    return (height * (first - variance / (8 * squared_root * root)) + 0.5 * miss * bend * (1 - bend * p / square)
            - third * change * change * change)


# -------------------------------------------------------------------------------------------------- legs, float64

def matched_leg(range_per_parameter, second, third, ray_parameter, speed):
    """Match a straight vector to a leg.

    Parameters
    ----------
    range_per_parameter, second, third : float64 (H,)
        Y, E and G of the module's equations. Where E is not positive (a ray beyond its caustic) there is no such
        vector: the one with the speed of the origin is taken, right to first order alone.
    ray_parameter : float64 (H,) [s/m]
    speed : float64 (H,) or float [m/s]
        Sound speed at the origin.

    Returns
    -------
    Leg
    """
    y, p, xp = range_per_parameter, ray_parameter, _library(ray_parameter)
    matched = (second > 0) & (y > 0)
    local = xp.maximum(1 / (speed * speed) - p * p, (LEVEL / speed) ** 2)
    e = _select(matched, second, y / local)
    g = _select(matched, third - e * e / xp.maximum(y, 1e-30), 0.0)
    speed = xp.sqrt(e / xp.maximum(y + p * p * e, 1e-30))
    u = xp.sqrt(y / xp.maximum(e, 1e-30))
    return Leg(y / speed, speed, p * speed, u * speed, 0.5 * g * p**3 / (speed * speed))


def centre_return(leg, travel_time, bearing, upwards, velocity, slice_to):
    """Follow the platform to where the echo meets the array's centre, and match the leg to there.

    Parameters
    ----------
    leg : Leg
        From the hit to the origin.
    travel_time : float64 (H,) [s]
        Of the traced ray, origin to hit.
    bearing : pair of float64 (H,) [-]
        Horizontal unit vector (x, y) from the origin to the hit.
    upwards : float64 (H,) [-]
        +1 where the returning ray comes up to the origin, -1 where it comes down.
    velocity : triple of float or float64 [m/s]
    slice_to : callable
        Height above the origin [m] -> mean [s²/m²] and variance [s⁴/m⁴] of 1/c² from the origin to there.

    Returns
    -------
    return_time : float64 (H,) [s]
        From the hit to the centre, where that is at reception.
    leg : Leg
        From the hit to the centre at reception.
    direction : triple of float64 (H,)
        n, the way the echo travels there.
    rise : float64 (H,) [m]
        Height of the centre at reception above the origin.
    """
    xp = _library(travel_time)
    vx, vy, vz = velocity
    n = (-bearing[0] * leg.horizontal, -bearing[1] * leg.horizontal, upwards * leg.vertical)
    wait = 2 * travel_time
    inverse = 1 / xp.maximum(leg.length, 1e-9)
    square = vx * vx + vy * vy + vz * vz
    toward = n[0] * vx + n[1] * vy + n[2] * vz
    closing = leg.speed - toward - inverse * square * wait
    delay = _straight(toward * wait, square * wait * wait, inverse, leg.speed, closing, leg.speed * leg.speed - square)
    height = upwards * vz * (wait + delay)
    mean, variance = slice_to(upwards * height)
    c2 = leg.speed * leg.speed
    excess = c2 * mean - 1
    delay = delay + _corrections(leg.vertical, leg.horizontal, leg.third, inverse, leg.speed * delay, height, excess,
                                 c2 * c2 * variance) / closing
    # the leg to there: the matched layer and the slice in a row, at the p that spans the new range; in units of c_m
    passed = wait + delay
    x, y = leg.length * n[0] + vx * passed, leg.length * n[1] + vy * passed
    across = xp.sqrt(x * x + y * y)
    layer, height = leg.length * leg.vertical, upwards * vz * passed
    p = across / xp.sqrt(across * across + xp.maximum(layer + height, 1e-9) ** 2)
    for _ in range(2):
        first, second = _two_layers(p, layer, height, excess)
        p = xp.minimum(p + (across - p * first) / (first + p * p * second), 1 - 0.5 * LEVEL**2)
    first, second = _two_layers(p, layer, height, excess)
    there = matched_leg(first, second, second * second / xp.maximum(first, 1e-30), p, 1.0)
    # a level ray has no layer to match; it only moves
    level = leg.vertical <= 2 * LEVEL
    there = Leg(_select(level, leg.length + toward * passed, there.length), leg.speed * _select(level, 1.0, there.speed),
                _select(level, leg.horizontal, there.horizontal), _select(level, leg.vertical, there.vertical),
                leg.third / there.speed**2)
    still = across < 1e-9
    scale = there.horizontal / _select(still, 1.0, across)
    direction = _select(still, 0.0, x * scale), _select(still, 0.0, y * scale), upwards * there.vertical
    return travel_time + delay, there, direction, upwards * height


def _two_layers(p, layer, height, excess):
    """Y and E, speeds in units of c_m, of the matched layer and the slice above it."""
    xp = _library(p)
    below = xp.maximum(1 - p * p, LEVEL**2)
    above = xp.maximum(below + excess, LEVEL**2)
    roots = xp.sqrt(below), xp.sqrt(above)
    return layer / roots[0] + height / roots[1], layer / (below * roots[0]) + height / (above * roots[1])


# --------------------------------------------------------------------------------------- fields of the difference

def hit_fields(leg, direction, rise, elapsed, velocity, turn_rate, origin_speed):
    """Make what `vector_difference` needs of the hits, in float64; round to float32 afterwards.

    Parameters
    ----------
    leg, direction, rise
        As `centre_return` gives them.
    elapsed : float64 (H,) [s]
        From the ping to the echo's arrival at the centre: the time the array has turned for.
    velocity : triple [m/s]
    turn_rate : triple [rad/s]
        Angular velocity of the platform, scene coordinates.
    origin_speed : float or float64 (H,) [m/s]
        Sound speed at the depth the element fields were made for.

    Returns
    -------
    list of float64 (H,)
        n (3) and the vertical (3) as the turned array sees them; 1/R, c_m, c_m - n·v, c_m² - |v|², n_z, v_z,
        (c_m / origin speed)² - 1, rise, γ.
    """
    vx, vy, vz = velocity
    zero = 0 * leg.speed
    toward = direction[0] * vx + direction[1] * vy + direction[2] * vz
    ratio = leg.speed / origin_speed
    return [*_turned_back(direction, turn_rate, elapsed), *_turned_back((zero, zero, zero + 1), turn_rate, elapsed),
            1 / leg.length, leg.speed, leg.speed - toward, leg.speed * leg.speed - (vx * vx + vy * vy + vz * vz),
            direction[2] + zero, vz + zero, (ratio - 1) * (ratio + 1), rise + zero, leg.third + zero]


def _turned_back(vector, turn_rate, elapsed):
    """Turn vectors by -turn_rate * elapsed (Rodrigues): their products with the array as it was at the ping."""
    xp = _library(elapsed)
    wx, wy, wz = turn_rate
    rate = (wx * wx + wy * wy + wz * wz) ** 0.5 + 1e-30
    kx, ky, kz = wx / rate, wy / rate, wz / rate
    x, y, z = vector
    sine, cosine = xp.sin(rate * elapsed), xp.cos(rate * elapsed)
    along = (kx * x + ky * y + kz * z) * (1 - cosine)
    return (x * cosine - (ky * z - kz * y) * sine + kx * along, y * cosine - (kz * x - kx * z) * sine + ky * along,
            z * cosine - (kx * y - ky * x) * sine + kz * along)


def vector_element_fields(offsets, depth, profile, velocity=(0, 0, 0), turn_rate=(0, 0, 0)):
    """Make what `vector_difference` needs of the elements (NumPy).

    Parameters
    ----------
    offsets : array (E, 3) [m]
        From the array's centre, scene coordinates, as the array stands at the ping.
    depth : float [m]
        Of the centre at the ping.
    profile : SoundSpeedProfile
    velocity : triple [m/s]
    turn_rate : triple [rad/s]

    Returns
    -------
    list of float64 (E,)
        d (3), |d|², v·d, turn_rate x d (3), c²<1/c²> - 1 and its change per metre of rise [1/m], variance of c²/c².
    """
    shared = _shared_element_fields(offsets, velocity, turn_rate)
    speed, height = profile.at(depth), shared[2]
    mean, variance = Slices(profile).between(depth, depth - height)
    ends = (speed / profile.at(depth - height)) ** 2 - 1
    level = np.abs(height) < 1e-6
    local = (profile.gradient(depth, "below") + profile.gradient(depth, "above")) / speed
    rate = np.where(level, local, ends / np.where(level, 1.0, height))
    return [*shared, speed**2 * mean - 1, rate, speed**4 * variance]


def _shared_element_fields(offsets, velocity, turn_rate):
    offsets = np.asarray(offsets, float)
    turning = np.cross(np.asarray(turn_rate, float), offsets)
    return [*offsets.T, np.sum(offsets**2, axis=-1), offsets @ np.asarray(velocity, float), *turning.T]


def vector_difference(hits, elements):
    """Give how much later than at the array's centre an echo arrives at an element.

    Parameters
    ----------
    hits : sequence of arrays
        As of `hit_fields`.
    elements : sequence of arrays
        As of `vector_element_fields`; both broadcast.

    Returns
    -------
    array [s]
        Of the type of the fields.
    """
    nx, ny, nz, zx, zy, zz, inverse, speed, closing, speeds, w, vz, faster, rise, third = hits
    dx, dy, dz, square, vd, ux, uy, uz, excess, rate, variance = elements
    xp = _library(nx * dx)
    upwards = xp.copysign(1.0 + 0 * w, w)
    closing = closing - (nx * ux + ny * uy + nz * uz) - inverse * vd
    delay = _straight(nx * dx + ny * dy + nz * dz, square, inverse, speed, closing, speeds)
    height = zx * dx + zy * dy + zz * dz + vz * delay
    local = excess + rate * (rise + 0.5 * (height - dz))
    total = local + faster + local * faster
    w = abs(w)
    scale = 1 + faster
    return delay + _corrections(w, xp.sqrt(xp.maximum(1 - w * w, 0)), third, inverse, speed * delay, upwards * height,
                                total, scale * scale * variance) / closing


# ----------------------------------------------------------------------------------------------- published formula

def paper_centre_return(travel_time, displacement, velocity, speed_at):
    """Find when and from where the echo meets the array's centre, by equation 2.

    Parameters
    ----------
    travel_time : float64 (H,) [s]
        Of the traced ray.
    displacement : triple of float64 (H,) [m]
        From the hit to the origin.
    velocity : triple [m/s]
    speed_at : callable
        Height above the origin [m] -> sound speed [m/s].

    Returns
    -------
    return_time : float64 (H,) [s]
    leg : Leg
        Straight, with the effective speed.
    direction : triple of float64 (H,)
    rise : float64 (H,) [m]
    """
    xp = _library(travel_time)
    vx, vy, vz = velocity
    x, y, z = (component + v * travel_time for component, v in zip(displacement, velocity))
    effective = xp.sqrt(sum(component * component for component in displacement)) / travel_time
    square, v_square, toward = x * x + y * y + z * z, vx * vx + vy * vy + vz * vz, x * vx + y * vy + z * vz
    time = travel_time
    for _ in range(2):
        rise = vz * (travel_time + time)
        speed = effective + COEFFICIENT * (speed_at(rise) - speed_at(0 * rise))
        remaining = speed * speed - v_square
        time = (toward + xp.sqrt(toward * toward + remaining * square)) / remaining
    x, y, z = x + vx * time, y + vy * time, z + vz * time
    length = xp.sqrt(x * x + y * y + z * z)
    direction = x / length, y / length, z / length
    return time, Leg(length, speed, xp.sqrt(x * x + y * y) / length, abs(direction[2]), 0 * length), direction, rise


def paper_element_fields(offsets, depth, profile, velocity=(0, 0, 0), turn_rate=(0, 0, 0)):
    """Make what `paper_difference` needs of the elements; arguments as of `vector_element_fields`.

    Returns
    -------
    list of float64 (E,)
        d (3), |d|², v·d, turn_rate x d (3), 0.503 times: c(element) - c(centre) [m/s], dc/dz (upwards) at the element
        less that at the centre, dc/dz at the element [1/s].
    """
    shared = _shared_element_fields(offsets, velocity, turn_rate)
    there = depth - shared[2]
    gradients = [-0.5 * (profile.gradient(z, "below") + profile.gradient(z, "above")) for z in (there, depth)]
    return [*shared, COEFFICIENT * (profile.at(there) - profile.at(depth)),
            COEFFICIENT * (gradients[0] - gradients[1]), COEFFICIENT * gradients[0]]


def paper_difference(hits, elements):
    """Give the same as `vector_difference` by the published formula; ``elements`` as of `paper_element_fields`."""
    nx, ny, nz, zx, zy, zz, inverse, speed, closing, speeds, _, vz, _, rise, _ = hits
    dx, dy, dz, square, vd, ux, uy, uz, faster, bend, slope = elements
    xp = _library(nx * dx)
    along = nx * dx + ny * dy + nz * dz
    higher = zx * dx + zy * dy + zz * dz + vz * along / speed - dz
    gain = (faster + bend * rise + slope * higher) / speed
    more = gain * (2 + gain)                                             # (ev / ev of the centre)^2 - 1
    length = 2 * along + inverse * square - more / inverse
    closing = closing + speed * more - (nx * ux + ny * uy + nz * uz) - inverse * vd
    return length / (closing + xp.sqrt(closing * closing + (speeds + speed * speed * more) * inverse * length))


DIFFERENCES = {"paper": paper_difference, "vector": vector_difference}
ELEMENT_FIELDS = {"paper": paper_element_fields, "vector": vector_element_fields}
