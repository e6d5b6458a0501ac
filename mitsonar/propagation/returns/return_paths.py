"""Legs of traced hits on the device: integrals of the exact ray that the vector approximation needs.

With H the depth difference, m_n the central moments of 1/c² between hit and origin, q² = <1/c²> - p², a_n = m_n / q^2n
(as in `two_point`):

    Y = (H / q)  (1 +  3/8 a2 -   5/16 a3 +   35/128 a4)
    E = (H / q³) (1 + 15/8 a2 -  35/16 a3 +  315/128 a4)
    G = (H / q⁵) (1 + 35/8 a2 - 105/16 a3 + 1155/128 a4)

where the ray is direct and the series converges. Else, and for G as long as a4 is below `THIRD_LIMIT`,

    Y = X/p,   E = (|D| - Y) / p²,   G = E²/Y (1 + 2/3 (E q²/Y - 1) (1 - 5/4 a3/a2))

with |D| from the spreading area; the form of G holds to second order of the series and, within 15 % of G - E²/Y, far
beyond. A turned ray's |D| hides a sign: its leg is right to first order only, which `rough` reports.
"""
from collections.abc import Callable, Sequence
from typing import Literal

import drjit as dr
import numpy as np

from mitsonar.device.rotations import rotated
from mitsonar.device.types import Bool, Float, Float64, Record, UInt32, Vector64

from ..device_rays.layer_table import LayerTable
from ..device_rays.two_point import LEVEL, SERIES_LIMIT, PointState, SourceState
from ..numpy_rays.paper_approximation import paper_centre_return
from .straight_vectors import dot, hit_fields
from .travel import Travel
from .vector_approximation import expected_error
from .vector_legs import centre_return, matched_leg

THIRD_LIMIT = 0.1         # a4 beyond which the series does not give the third order either


class ReturnPaths(Record):
    """Return legs to the array's centre."""

    return_time: Float64  # (H,) [s]: from the hit to the centre, where that is at reception
    hit_fields: list[Float]  # (H,): for the `DIFFERENCES` of the method
    direction: tuple[Float, Float, Float]  # (H,): of travel at the centre, unit vectors in scene coordinates
    rough: Bool  # (H,): the ray turned between the ends, or runs nearly level
    later: Float64 | None = None  # [s]: fields and direction are those of sound that leaves this much later

    def expected_error(self, element_fields: Sequence[np.ndarray],
                       of_pair: Callable[[Sequence[Float], Sequence[Float]], Float] = expected_error) -> Float:
        """Return the largest error to expect of the method "vector" at some elements, by a function of both fields."""
        # element_fields (E,) -> (H,) [s]
        kind = type(self.hit_fields[0])
        error = dr.select(self.rough, dr.inf, kind(0))
        for k in range(len(element_fields[0])):
            element = [dr.opaque(kind, float(field[k])) for field in element_fields]
            error = dr.maximum(error, of_pair(self.hit_fields, element))
        return error


def return_paths(table: LayerTable, source: SourceState | PointState, source_index: UInt32, displacement: Vector64,
                 travel_time: Float64, ray_parameter: Float64, spreading_area: Float, launch_sine: Float, *,
                 travel: Travel, method: Literal["vector", "paper"] = "vector",
                 elapsed: Float64 | None = None, slope: Vector64 | None = None,
                 later: Float64 | None = None) -> ReturnPaths:
    """Carry the echoes of traced hits back to the centre of the moving, turning array.

    With `later`, only the times are of echoes that leave at `elapsed`; all else is of echoes that leave so much later.
    """
    # source_index (H,); displacement (H,) [m]; travel_time (H,) [s]; ray_parameter (H,) [s/m];
    # spreading_area (H,) [m²/sr]; launch_sine (H,); elapsed (H,) [s]
    lib = table.lib
    F, wide = lib.Float, lib.Float64
    elapsed = travel_time if elapsed is None else elapsed
    z0, c0, moments0 = source.gather(lib, source_index)
    up = dr.select(launch_sine >= 0, wide(1), wide(-1))          # a ray launched down comes up again
    x = dr.sqrt(dr.fma(displacement.x, displacement.x, displacement.y * displacement.y))
    y, e, g, rough = _integrals(table, z0, c0, moments0, z0 - displacement.z, x, ray_parameter,
                                 wide(spreading_area), up)
    exact = matched_leg(y, e, g, ray_parameter, c0)
    if method == "vector":
        upright = x < 1e-9
        scale = dr.rcp(dr.select(upright, 1, x))
        bearing = dr.select(upright, 1, displacement.x * scale), dr.select(upright, 0, displacement.y * scale)
        time, received, leg, vector, rise = centre_return(exact, travel_time, bearing, up, travel,
                                                          _slice_to(table, z0, moments0), elapsed, later)
        # the vector has the ray's p, but the sound speed of the leg
        bend = table.at(z0 - rise)[0] / leg.speed
        cosine = dr.sqrt(dr.maximum(1 - dr.square(bend * leg.horizontal), 0))
        direction = vector[0] * bend, vector[1] * bend, up * cosine
    else:
        time, leg, vector, rise = paper_centre_return(
            travel_time, (-displacement.x, -displacement.y, -displacement.z), travel, lambda h: table.at(z0 - h)[0],
            elapsed)
        received = elapsed + time
        if later is not None:
            there, leg, vector, rise = paper_centre_return(
                travel_time, (-displacement.x, -displacement.y, -displacement.z), travel,
                lambda h: table.at(z0 - h)[0], elapsed + later)
            received = elapsed + later + there
        direction = vector
    if slope is not None:
        time += dot(slope, travel.moved(elapsed + time))
    if later is None:
        received = elapsed + time
    fields = hit_fields(leg, vector, rise, received, travel, c0)
    if slope is not None:            # the delay of an element at d is n·d / (c - v·n), so that n carries the slope
        turned = rotated([part * fields[8] for part in slope], travel.turned(received), back=True)
        fields[:3] = [part + more for part, more in zip(fields[:3], turned)]
    return ReturnPaths(return_time=time, hit_fields=[F(field) for field in fields],
                       direction=tuple(F(component) for component in direction), rough=rough, later=later)


def _integrals(table: LayerTable, z0: Float64, c0: Float64, moments0: list[Float64], z: Float64, x: Float64, p: Float64,
               area: Float64, up: Float64) -> tuple[Float64, Float64, Float64, Bool]:
    """Return Y, E, G of each leg in SI, and a mask of rough legs."""
    c, moments = table.at(z)
    height = abs(z - z0)
    per_height = dr.sign(z - z0) / dr.maximum(height, 1e-9)
    n1, n2, n3, n4 = ((moments[i] - moments0[i]) * per_height for i in range(4))
    m2 = dr.maximum(n2 - n1 * n1, 0)
    m3 = n3 - n1 * (3 * n2 - 2 * n1 * n1)
    m4 = n4 - n1 * (4 * n3 - n1 * (6 * n2 - 3 * n1 * n1))
    q2 = 1 + n1 - p * p * table.scale                            # in units of r0
    w = dr.rcp(dr.maximum(q2, 1e-12))
    a2, a3, a4 = m2 * w * w, m3 * w * w * w, m4 * (w * w) * (w * w)
    q = dr.sqrt(w * table.scale)                                 # 1/q in SI
    y = height * q * (1 + 3 / 8 * a2 - 5 / 16 * a3 + 35 / 128 * a4)
    e = height * q * q * q * (1 + 15 / 8 * a2 - 35 / 16 * a3 + 315 / 128 * a4)
    g = height * q * q * q * q * q * (1 + 35 / 8 * a2 - 105 / 16 * a3 + 1155 / 128 * a4)
    direct = ((z - z0) * up > 0) & (q2 > 0) & (height >= LEVEL * x)
    series = direct & (abs(a4) < SERIES_LIMIT)
    # beyond the series the ray is far from upright: no division by zero, no cancellation
    per_p = x / dr.maximum(p, 1e-9)
    sines = dr.sqrt(dr.maximum((1 - p * p * c0 * c0) * (1 - p * p * c * c), 1e-12))
    slope = area * c0 * c0 / dr.maximum(per_p * sines, 1e-9)
    y = dr.select(series, y, per_p)
    rest = e * e / dr.maximum(y, 1e-9)
    e = dr.select(series, e, (slope - per_p) / dr.maximum(p * p, 1e-18))
    uneven = dr.maximum(e / (dr.maximum(y, 1e-9) * q * q) - 1, 0)
    lopsided = dr.clip(1 - 1.25 * a3 / dr.maximum(a2, 1e-12), 0.5, 1.6)
    rough = ~series & ~(direct & (abs(a4) < THIRD_LIMIT))
    squared = e * e / dr.maximum(y, 1e-9)
    third = dr.select(series, g - rest, dr.select(rough, 0, squared * (2 / 3) * uneven * lopsided))
    return y, e, squared + third, rough


def _slice_to(table: LayerTable, z0: Float64, moments0: list[Float64]) -> Callable[[Float64], tuple[Float64, Float64]]:
    """Return the look-up that `centre_return` asks for."""
    def mean_and_variance(rise: Float64) -> tuple[Float64, Float64]:
        c, moments = table.at(z0 - rise)
        thin = abs(rise) < 1e-9
        thickness = dr.select(thin, 1, -rise)
        first, second = ((moments[i] - moments0[i]) / thickness for i in range(2))
        first = dr.select(thin, table.scale / (c * c) - 1, first)
        variance = dr.select(thin, 0, dr.maximum(second - first * first, 0))
        return (1 + first) * table.reference, variance * table.reference * table.reference

    return mean_and_variance
