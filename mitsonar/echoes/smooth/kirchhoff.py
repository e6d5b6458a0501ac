"""Kirchhoff's integral over cells of bent surfaces, part by part.

Sound meets a cell as a whole along one ray, and goes back along one. Over the cell the bent surface is cut into m²
parts so small that a phase is linear over each and no angle is left at which they act as a grating:

    <n·u e^iφ> = (1/m²) Σ_j ½ (n_j·u_s + n_j·u_r) <e^iφ>_j,    φ = -k (|x - s| - |x_c - s| + |x - r| - |x_c - r|)

s and r where the wave comes from and goes to, at the radius of its curvature behind the cell's middle x_c; n_j the
surface's own normal in the middle of part j, which counts where both s and r see it (`facets` on heights and normals,
`scattering.facets` on the means).
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from mitsonar.scattering.surfaces.facets import phase_mean

from ..scatterers.cells import place
from .facets import SmoothCells, SmoothFacets

CORNERS = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)


def further(offset: mi.Vector3f, direction: mi.Vector3f, radius: mi.Float) -> mi.Float:
    """How much further a spherical wave of a radius [m] along `direction` has come at `offset` [m] from its middle."""
    twice = 2 * radius * dr.dot(direction, offset) + dr.squared_norm(offset)
    return twice / (dr.sqrt(dr.maximum(radius * radius + twice, 0)) + radius)


def mean_sent_back(facets: SmoothFacets, cells: SmoothCells, parts: mi.UInt32,
                   ways: Sequence[tuple[mi.Vector3f, mi.Float]], wavenumber: mi.Float,
                   active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """Mean of n·u e^iφ over cells, from one place to another."""
    # parts (R,); ways (Vector3f, Float) [m]; wavenumber (R,) [rad/m]; active (R,) -> real, imaginary (R,)
    bend, normals = facets.bend_of(cells.facet, active), facets.normals_of(cells.facet, active)
    return _summed(facets.lib, parts, cells.flat, cells.places, bend, normals, cells.normal, ways, wavenumber, active)


@dr.syntax
def _summed(lib, parts, flat, places, bend, normals, normal, ways, wavenumber, active):
    # -------------------------------------------------- loop state
    j = mi.UInt32(0)                                             # part
    real, imaginary = mi.Float(0), mi.Float(0)                   # sums so far
    active = mi.Bool(active)
    one = dr.opaque(mi.UInt32, 1)
    while active:
        a, b = _part(lib, j, parts, flat, places, bend, normals, normal, ways, wavenumber)
        real += a
        imaginary += b
        j += one
        active = active & (j < parts * parts)
    share = 1 / (mi.Float(parts) * mi.Float(parts))
    return real * share, imaginary * share


def _part(lib, j, parts, flat, places, bend, normals, normal, ways, wavenumber):
    (direction, radius), other = ways[0], ways[1:]
    phases, (a, b, c) = [], normals
    middle_u, middle_v = 0, 0
    for x, y in CORNERS:
        s, t = (mi.Float(w) for w in place(lib, j, parts, lib.Float64(x), lib.Float64(y)))
        (u, v), offset = (start + (first - start) * s + (second - start) * t for start, first, second in
                          ((mi.Point2f(*places[0]), mi.Point2f(*places[1]), mi.Point2f(*places[2])), flat))
        height = bend[0] * (1 - u - v) * u + bend[1] * u * v + bend[2] * v * (1 - u - v)
        offset = offset + height * normal
        there = further(offset, direction, radius)
        phases.append(-wavenumber * (there + further(offset, *other[0])) if other else -2 * wavenumber * there)
        middle_u, middle_v = middle_u + u * (1 / 3), middle_v + v * (1 / 3)
    n = dr.normalize(a + (b - a) * middle_u + (c - a) * middle_v)
    # whichever side of the facet the sound is on
    side = -dr.dot(normal, direction)
    cosine = dr.maximum(dr.mulsign(-dr.dot(n, direction), side), 0)
    if other:
        back = dr.maximum(dr.mulsign(-dr.dot(n, other[0][0]), side), 0)
        cosine = dr.select((cosine > 0) & (back > 0), 0.5 * (cosine + back), 0)
    mean = phase_mean(*phases)
    return cosine * mean[0], cosine * mean[1]
