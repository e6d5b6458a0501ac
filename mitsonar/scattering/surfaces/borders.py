"""Borders between sediments: a mosaic of patches of both, whose shares change gradually across a width.

    σ(x) = Σ_k w_k(x) σ_k,     w_k(x) = ∫ K(d) [class(x + d) = k] dd,     K triangular, of base w

w -> ``width``. Strengths are mixed, not parameters: between mud and gravel there are patches of both, not sand.
A place has one class, drawn with these shares by a hash of its 5 cm square, so that every ray, ping and run meets the
same patches; a resolution cell of some decimetres averages over them. Drawing the displacement d instead of the class
is stochastic filtering after shading (Pharr et al. 2024, Proc. ACM Comput. Graph. Interact. Tech.).
"""
from __future__ import annotations

import drjit as dr

from mitsonar.device.chance import Salt, hashed_pair, uniform
from mitsonar.device.types import ArrayTypes, Float

PATCH = 0.05                       # [m] side of the squares


def drawn(lib: ArrayTypes, x: Float, y: Float) -> tuple[Float, Float]:
    """Return two hashed numbers in [0, 1), Float (R,), of the squares that hold the places x, y [m] (R,)."""
    i, j = (lib.UInt32(lib.Int32(dr.floor(v * dr.opaque(lib.Float, 1 / PATCH)))) for v in (x, y))
    first, second = hashed_pair(lib, i, j, lib.UInt32(Salt.BORDER))
    return uniform(lib, first), uniform(lib, second)


def displacement(lib: ArrayTypes, x: Float, y: Float) -> tuple[Float, Float]:
    """Return the displacements d / w, Float (R,) in -1/2 to 1/2, of places x, y [m] (R,)."""
    first, second = drawn(lib, x, y)
    return _triangular(first), _triangular(second)


def _triangular(u):
    """Map uniform numbers in [0, 1) to a triangular density on -1/2 to 1/2."""
    return 0.5 * (dr.sqrt(2 * dr.minimum(u, 1 - u)) - 1) * dr.select(u < 0.5, 1, -1)
