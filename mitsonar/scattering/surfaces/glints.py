"""Glints: shells and pebbles too small for a mesh, each of them a strong scatterer of its own.

    g = 1 - s + s N / (β a),     N ~ Poisson(β a),     a^(3/2) = dA^(3/2) + d³:     <g> = 1
    <I²>/<I>² = 2 (1 + s² / (β A)),     A = (∫ b dA)² / ∫ b² dA

β -> ``per_area`` [1/m²], s -> ``share`` of the mean strength that glints have, dA -> ``area`` [m²] that a scatterer
stands for, d = 2 cm the side of the squares that N is hashed from; I the intensity of an echo from a resolution cell of
the area A, b its two-way response. The scatterers of an echo are circular Gaussians of the mean squares g dA, so the
echo is one, too, of the mean square S = Σ g dA. Glints are strewn at random: those of all scatterers together are
Poisson(β A) in number, and <S²>/<S>² = 1 + s²/(β A). This is the second moment of a K-distribution of the shape
ν = β A / s², and with s = 1 the seabed of few scatterers by which Abraham and Lyons explain it (2002, IEEE J. Oceanic
Eng. 27, 800; 2004, IEEE J. Oceanic Eng. 29, 126). Unlike patches, glints make neighbouring cells differ.

How many scatterers a sonar has does not matter. Where each stands for far more than a square, the numbers N are
independent, and a = dA. Where each stands for less, those of one square share its N, so that every sonar as fine as
that meets the same glints in the same places; then a = d². Between the two, a is fitted to the nested sequence of
scatterers (`echoes.scatterers.nested_points`): s²/(β A) is right to 4 %.

N is the quantile of the square's hash. Means above 3 have a uniform distribution of the same mean and variance in place
of Poisson's, since many scatterers with many glints each are near Gaussian.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from mitsonar.device.chance import Salt, hashed, uniform
from mitsonar.device.types import ArrayTypes, Float

SQUARE = 0.02                      # d [m]
LARGEST_MEAN = 3.0                 # of Poisson's distribution: twelve terms of it leave out 2e-5 of the mean
TERMS = 12
ROUNDED = 2e-7                     # chances that single precision does not resolve
FEWEST, MOST = 0.1, 10_000.0       # [1/m²]


@dataclass(frozen=True, kw_only=True)
class Glints:
    """Density of a bed's glints and their share of its strength."""

    per_area: float  # β [1/m²]
    share: float  # s [-]

    def __post_init__(self) -> None:
        if not FEWEST <= self.per_area <= MOST:
            raise ValueError(f"glints are {self.per_area} per m²; give {FEWEST:g} to {MOST:g}.")
        if not 0 <= self.share <= 1:
            raise ValueError(f"glint_share is {self.share}; it must lie in 0..1.")


def with_glints(lib: ArrayTypes, x: Float, y: Float, area: Float, per_area: Float, share: Float) -> Float:
    """Return g [-], Float (R,), of scatterers at x, y [m] that stand for areas [m²], Float (R,)."""
    i, j = (lib.UInt32(lib.Int32(dr.floor(v * (1 / SQUARE)))) for v in (x, y))
    u = uniform(lib, hashed(lib, i, j, lib.UInt32(Salt.GLINT)))
    root = dr.sqrt(area)
    mean = per_area * dr.square(dr.cbrt(area * root + SQUARE ** 3))
    few = dr.minimum(mean, LARGEST_MEAN)
    term = dr.exp(-few)
    above, number = 1 - term, lib.Float(0)              # above: chance of more than `number`
    for n in range(1, TERMS + 1):
        number += dr.select((u < above) & (above > ROUNDED), 1.0, 0.0)
        term *= few / n
        above -= term
    even = 1 + float(np.sqrt(12)) * dr.rsqrt(dr.maximum(mean, LARGEST_MEAN)) * (u - 0.5)
    relative = dr.select(mean > LARGEST_MEAN, even, number / dr.maximum(few, 1e-12))
    return 1 - share + share * relative
