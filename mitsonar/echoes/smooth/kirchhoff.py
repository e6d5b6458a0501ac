"""Kirchhoff's integral over cells of curved surfaces, part by part.

Sound reaches a cell along one ray and returns along one. The curved surface over the cell is cut into m² parts, so
small that the phase is linear over each and that they have no grating angle:

    <n·u e^iφ> = (1/m²) Σ_j ½ (n_j·u_s + n_j·u_r) <e^iφ>_j,    φ = -k (|x - s| - |x_c - s| + |x - r| - |x_c - r|)

s and r are the places that the wave comes from and goes to, at the radius of its curvature behind the cell's middle
x_c. n_j is the surface's own normal in the middle of part j, which counts if both s and r see it. (`facets` has heights
and normals, `scattering.surfaces.facets` the means.)
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from mitsonar.propagation.returns.moved_ends import further
from mitsonar.scattering.surfaces.facets import phase_mean

from ..scatterers.cells import place
from .facets import SmoothCells, SmoothFacets

CORNERS = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)


def off_middle(offset: mi.Vector3f, direction: mi.Vector3f, radius: mi.Float) -> mi.Float:
    """Return the extra distance of a spherical wave of a radius [m] along `direction`, `offset` [m] off its middle."""
    return further(2 * radius * dr.dot(direction, offset) + dr.squared_norm(offset), radius)


def mean_sent_back(facets: SmoothFacets, cells: SmoothCells, parts: mi.UInt32,
                   ways: Sequence[tuple[mi.Vector3f, mi.Float]], wavenumber: mi.Float,
                   active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """Return the mean of n·u e^iφ over cells between two places, as real and imaginary part (R,)."""
    # parts (R,); ways (direction, radius [m]); wavenumber (R,) [rad/m]; active (R,)
    bend, normals = facets.bend_of(cells.facet, active), facets.normals_of(cells.facet, active)
    return _summed(facets.lib, parts, cells.flat, cells.places, bend, normals, cells.normal, ways, wavenumber, active)


@dr.syntax
def _summed(lib, parts, flat, places, bend, normals, normal, ways, wavenumber, active):
    j = mi.UInt32(0)                                             # loop state: part, sums so far
    real, imaginary, active = mi.Float(0), mi.Float(0), mi.Bool(active)
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
        there = off_middle(offset, direction, radius)
        phases.append(-wavenumber * (there + off_middle(offset, *other[0])) if other else -2 * wavenumber * there)
        middle_u, middle_v = middle_u + u * (1 / 3), middle_v + v * (1 / 3)
    n = dr.normalize(a + (b - a) * middle_u + (c - a) * middle_v)
    # for sound on either side of the facet
    side = -dr.dot(normal, direction)
    cosine = dr.maximum(dr.mulsign(-dr.dot(n, direction), side), 0)
    if other:
        back = dr.maximum(dr.mulsign(-dr.dot(n, other[0][0]), side), 0)
        cosine = dr.select((cosine > 0) & (back > 0), 0.5 * (cosine + back), 0)
    mean = phase_mean(*phases)
    return cosine * mean[0], cosine * mean[1]
