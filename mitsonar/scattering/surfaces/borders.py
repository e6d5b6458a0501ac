"""Borders between sediments: patches of both, whose shares go over from one to the other across a width.

    σ(x) = Σ_k w_k(x) σ_k,     w_k(x) = ∫ K(d) [class(x + d) = k] dd,     K triangular, of base w

w -> ``width``. Strengths are mixed, not parameters: between mud and gravel lies no sand, but mud here and gravel there.
A place takes one class, drawn with these shares by a hash of the 5 cm square that it lies in, so that every ray, ping
and run finds the same patches; a resolution cell of some decimetres hears the mixture. To draw the displacement d in
place of the class is stochastic filtering after shading (Pharr et al. 2024, Proc. ACM Comput. Graph. Interact. Tech.).
"""
from __future__ import annotations

import drjit as dr

from mitsonar.device.chance import Salt, hashed_pair, uniform
from mitsonar.device.types import ArrayTypes, Float

PATCH = 0.05                       # [m] side of the squares


def drawn(lib: ArrayTypes, x: Float, y: Float) -> tuple[Float, Float]:
    """Return two numbers in [0, 1), Float (R,), that belong to the squares which places x, y [m] (R,) lie in."""
    i, j = (lib.UInt32(lib.Int32(dr.floor(v * dr.opaque(lib.Float, 1 / PATCH)))) for v in (x, y))
    first, second = hashed_pair(lib, i, j, lib.UInt32(Salt.BORDER))
    return uniform(lib, first), uniform(lib, second)


def displacement(lib: ArrayTypes, x: Float, y: Float) -> tuple[Float, Float]:
    """Return displacements d / w, Float (R,), in -1/2 to 1/2 each, of places x, y [m] (R,)."""
    first, second = drawn(lib, x, y)
    return _triangular(first), _triangular(second)


def _triangular(u):
    """Numbers in -1/2 to 1/2 of a triangular density, from such in [0, 1)."""
    return 0.5 * (dr.sqrt(2 * dr.minimum(u, 1 - u)) - 1) * dr.select(u < 0.5, 1, -1)
