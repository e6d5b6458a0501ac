"""Places of the scatterers of a facet: one sequence for all sonars, of which each takes as many as it needs.

A facet (a, b, c) is cut into four congruent triangles, each of these again, and so on: three at the corners a, b and c
(digits 0, 1, 2), and one in the middle, upside down (3). The path to scatterer k = 0, 1, 2 ... is

    y = S(k),    digit of level i = (y >> 2 i) & 3,    level 0 the coarsest                                          (1)

S mixes the bits of k with a seed so that bit i of y depends on bits 0 to i of k alone, one to one. The first 4^L
scatterers therefore lie in the 4^L triangles of level L, one in each, and those of the triangle in which scatterer p
lies are k = p + 4^L j, j = 0, 1, 2 ... (nested scrambling of the triangular van der Corput sequence: Owen 1995; Laine
and Karras 2011, Computer Graphics Forum 30, 1197; Basu and Owen 2015, SIAM J. Numer. Anal. 53, 743).

A sonar that needs m scatterers of a facet takes those with

    k + h < m,    h in [0, 1) hashed from the facet,                                                                 (2)

each for the area A / m. m may be any number and may vary over the facet. Sets are nested: of two sonars with densities
m < m', the second has all scatterers of the first. Their sums over the same ground correlate by √(m / m') of what the
sonars' resolutions say, and wholly where they need the same density.

Written for NumPy and Dr.Jit integers.
"""
from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np

from mitsonar.device.chance import scrambled
from mitsonar.device.types import Bool, Float, Numbers, UInt32

LEVELS = 16                        # of triangles: a place is exact to 2^-16 of the sides
MOST_OF_A_FACET = 2.0 ** 31        # scatterers, as k is a 32-bit number; larger facets have them less dense


def triangle_of(path: Any, level: Any = LEVELS) -> tuple[Numbers, Numbers, Numbers]:
    """Return the triangles of a level (R,) at the end of paths (R,): barycentric coordinates of a corner, and the side.

    The other two corners lie one side further towards b and towards c; a side is negative where the triangle is upside
    down. With the bits r and p of a digit, 1 for right or up, a corner is

        u = Σ_i s_i r_i 2^-(i + 1),   v = Σ_i s_i p_i 2^-(i + 1),   s_i = (-1)^(digits 3 before i)
    """
    U: Any = type(path) if dr.is_array_v(path) else np.uint32
    F: Any = dr.float32_array_t(U) if dr.is_array_v(path) else np.float32
    one = U(1)
    inside = (one << U(level)) - one
    right, up = _every_second(path, U) & inside, _every_second(path >> U(1), U) & inside
    turns = right & up
    for step in (1, 2, 4, 8):                           # parity of the bits below and including each
        turns = turns ^ (turns << U(step))
    before, all_turns = turns << one, turns & (one << (U(level) - one)) if np.ndim(level) or level else U(0)
    corner = [(F(_reversed(bits & ~before, U)) - F(_reversed(bits & before, U))) * F(2.0 ** -16)
              for bits in (right, up)]
    size = F(one << (U(LEVELS) - U(level))) * F(2.0 ** -16)
    side = dr.select(all_turns != 0, -size, size) if dr.is_array_v(path) else np.where(all_turns != 0, -size, size)
    return corner[0], corner[1], side


def _every_second(bits: Any, U: Any) -> Any:
    """Return the even bits of words, packed into 16."""
    bits = bits & U(0x55555555)
    for shift, mask in ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF)):
        bits = (bits | (bits >> U(shift))) & U(mask)
    return bits


def _reversed(bits: Any, U: Any) -> Any:
    """Return the lowest 16 bits of words in reverse order."""
    for shift, mask in ((1, 0x5555), (2, 0x3333), (4, 0x0F0F), (8, 0x00FF)):
        bits = ((bits >> U(shift)) & U(mask)) | ((bits & U(mask)) << U(shift))
    return bits


def place_of(k: Any, seed: Any) -> tuple[Numbers, Numbers]:
    """Return barycentric coordinates (u towards b, v towards c) of scatterers, float32 (R,)."""
    u, v, side = triangle_of(scrambled(k, seed))
    return u + side / 3, v + side / 3


def exists(k: UInt32, threshold: Float, m: Float) -> Bool:
    """Return True for scatterers that exist for a sonar, by (2); `threshold` is h."""
    return type(m)(k) + threshold < m


@dr.syntax
def owner_of(u: Float, v: Float, seed: UInt32, count: UInt32) -> UInt32:
    """Return the scatterer k < `count` that owns a point (R,) of the facet.

    Each of the first 4^L scatterers owns its triangle of level L, less the finer triangles that have an owner.
    """
    one: Any = type(u)(1)
    U: Any = type(seed)
    owner, power, path, level = U(0), U(1), U(0), U(0)
    while power < count:
        middle = (u < 0.5) & (v < 0.5) & (u + v >= 0.5)
        digit = dr.select(middle, U(3), dr.select(u >= 0.5, U(1), dr.select(v >= 0.5, U(2), U(0))))
        # within the smaller triangle, whose sides become 1
        u, v = (dr.select(middle, 1 - 2 * u, 2 * u - dr.select(digit == 1, one, 0)),
                dr.select(middle, 1 - 2 * v, 2 * v - dr.select(digit == 2, one, 0)))
        path |= digit << (2 * level)
        # S is one to one: of the four numbers that end like the owner's, one has this path
        mask, finer = (power << 2) - 1, owner
        for step in range(1, 4):
            candidate = owner + power * step
            finer = dr.select((scrambled(candidate, seed) ^ path) & mask == 0, candidate, finer)
        owner = dr.select(finer < count, finer, owner)
        power <<= 2
        level += 1
    return owner
