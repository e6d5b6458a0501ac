"""Derivatives of range and time of a ray through one layer by the sound speed in it, for NumPy and Dr.Jit numbers.

A ray of parameter p passes a layer of gradient g from depth z1, speed c1, sine s1 to z2, c2, s2; depths and sines are
positive down, so that dz / s is positive on the way up, too. With u = z - z1 and a change of speed a + b u,

    dX = a G0 + b G1,    G_m = p ∫ u^m / s³ dz                                    range at fixed p and depths
    dT = p dX - a F0 - b F1,    F_m = ∫ u^m / (c² s) dz                             time; F alone at fixed ends (Fermat)

    F0 = A / g,    F1 = (L - c1 A) / g²         A = s1/c1 - s2/c2,    L = atanh s1 - atanh s2
    G0 = p B / g,  G1 = p (C - c1 B) / g²       B = c2/s2 - c1/s1,    C = (1/s2 - 1/s1) / p²
    dX/dp = ∫ c / s³ dz = C / g = D
    dD/dp = ∫ 3 p c³ / s⁵ dz,    dD = a H0 + b H1,    H_m = ∫ u^m (1 + 2 p² c²) / s⁵ dz

Through a turning point the sine changes sign and the formulas go on to hold: what is infinite there in the integrals
of 1/s³ belongs to the turning point's own motion and leaves their finite part. Where a layer bends a ray little the
quotients cancel; seven Gauss points integrate such a layer to rounding.
"""
from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from mitsonar.device.types import Numbers

GENTLE = 0.15              # relative change of s² up to which seven points are exact to 1e-16
LEVEL_SINE = 1e-9          # a ray that is level at the edge of a layer: the infinite terms of both sides cancel
_PLACES, _WEIGHTS = ((1 + np.polynomial.legendre.leggauss(7)[0]) / 2, np.polynomial.legendre.leggauss(7)[1] / 2)


class ArcDerivatives(NamedTuple):
    """Derivatives of the time and range of one arc; see the equations."""

    time: Numbers  # [s²/m]: F0
    time_slope: Numbers  # [s²]: F1
    range: Numbers  # [s]: G0
    range_slope: Numbers  # [m s]: G1
    spread: Numbers  # [m²/s]: dX/dp


class SpreadDerivatives(NamedTuple):
    """Derivatives of dX/dp of one arc; see the equations."""

    parameter: Numbers  # [m³/s²]: dD/dp
    speed: Numbers  # [m]: H0
    slope: Numbers  # [m²]: H1


def spread_derivatives(parameter: Numbers, gradient: Numbers, descent: Numbers, c1: Numbers, s1: Numbers, c2: Numbers,
                       s2: Numbers) -> SpreadDerivatives:
    """Return the derivatives of dX/dp over an arc by ray parameter and layer speed; see `arc_derivatives`."""
    xp: Any = dr if dr.is_jit_v(parameter * c1) else np
    select: Any = dr.select if xp is dr else np.where
    s1, s2 = _not_level(xp, select, s1), _not_level(xp, select, s2)
    square1, square2, squared = s1 * s1, s2 * s2, parameter * parameter
    least = xp.minimum(square1, square2)
    gentle = (s1 * s2 > 0) & (abs(square1 - square2) <= GENTLE * least)
    by_p, h0, h1 = (0.0,) * 3
    sign = select(s1 > 0, 1.0, -1.0)
    for place, weight in zip(_PLACES.tolist(), _WEIGHTS.tolist()):
        u = place * descent
        c = c1 + gradient * u
        square = xp.maximum(square1 - squared * (c - c1) * (c + c1), 0.5 * least)
        part = sign * weight * descent / (xp.sqrt(square) * square * square)
        wide = (1 + 2 * squared * c * c) * part
        by_p, h0, h1 = by_p + 3 * parameter * c * c * c * part, h0 + wide, h1 + u * wide
    slope = select(gentle, 1.0, gradient)
    cube1, cube2, apart = 1 / (square1 * s1), 1 / (square2 * s2), (1 / s2 - 1 / s1) / squared
    return SpreadDerivatives(
        select(gentle, by_p, ((c2 * c2 * cube2 - c1 * c1 * cube1) / parameter - 2 * apart / parameter) / slope),
        select(gentle, h0, (c2 * cube2 - c1 * cube1) / slope),
        select(gentle, h1, (c2 * descent * cube2 - apart / slope) / slope))


def arc_derivatives(parameter: Numbers, gradient: Numbers, descent: Numbers, c1: Numbers, s1: Numbers, c2: Numbers,
                    s2: Numbers) -> ArcDerivatives:
    """Integrate over an arc within one layer, which may turn in it."""
    # parameter [s/m]; gradient [1/s]; descent [m]; c1, c2 [m/s]
    xp: Any = dr if dr.is_jit_v(parameter * c1) else np
    select: Any = dr.select if xp is dr else np.where
    arctanh: Any = dr.atanh if xp is dr else np.arctanh
    s1, s2 = _not_level(xp, select, s1), _not_level(xp, select, s2)
    square1, square2, squared = s1 * s1, s2 * s2, parameter * parameter
    turns = s1 * s2 < 0
    least = xp.minimum(square1, square2)
    gentle = ~turns & (abs(square1 - square2) <= GENTLE * least)
    f0, f1, g0, g1, spread = (0.0,) * 5
    sign = select(s1 > 0, 1.0, -1.0)
    for place, weight in zip(_PLACES.tolist(), _WEIGHTS.tolist()):
        u = place * descent
        c = c1 + gradient * u
        # kept above zero where the layer is not gentle and this result is unused
        square = xp.maximum(square1 - squared * (c - c1) * (c + c1), 0.5 * least)
        part = sign * weight * descent / xp.sqrt(square)
        time, wide = part / (c * c), part / square
        f0, f1, g0, g1, spread = f0 + time, f1 + u * time, g0 + wide, g1 + u * wide, spread + c * wide
    slope = select(gentle, 1.0, gradient)
    change = c2 - c1
    a, b = s1 / c1 - s2 / c2, c2 / s2 - c1 / s1
    both = xp.minimum(xp.maximum((s1 - s2) / select(gentle, 1.0, 1 - s1 * s2), -1.0), 1.0)
    log = arctanh(select(gentle, 0.0, both))
    # C - c1 B without the difference of two large numbers beside a turning point
    rest = ((square1 - squared * c1 * change) / s2 - s1) / squared
    return ArcDerivatives(
        select(gentle, f0, a / slope), select(gentle, f1, (log - c1 * a) / slope ** 2),
        parameter * select(gentle, g0, b / slope), parameter * select(gentle, g1, rest / slope ** 2),
        select(gentle, spread, (1 / s2 - 1 / s1) / (squared * slope)))


def _not_level(xp: Any, select: Any, sine: Numbers) -> Numbers:
    """Keep a sine from zero, with its sign."""
    return select(abs(sine) > LEVEL_SINE, sine, select(sine < 0, -LEVEL_SINE, LEVEL_SINE))
