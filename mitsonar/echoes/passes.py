"""Amplitudes of scatterers in passes over the same ground, which may be disturbed in between.

In pass n a scatterer of the coherence c, a number that its material has, sends back with the amplitude

    a_n = √c g + √(1 - c) h_n

g and h_n independent complex Gaussians of unit mean square, g of the scatterer alone and h_n of it in that pass. So
<a_m a_n*> = c for any two passes, and <|a_n|²> = 1 (the temporal coherence of Zebker and Villasenor, 1992, IEEE Trans.
Geosci. Remote Sens. 30, 950). With c = 0 pass 0 has g.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..device.arrays import arrays_of
from ..device.chance import Salt, gaussian, hashed_pair
from ..scene.geometry import Geometry
from ..scene.materials import coherence, loses_coherence

__all__ = ["Amplitudes"]


class Amplitudes:
    """Give scatterers their amplitudes.

    Parameters
    ----------
    geometry : Geometry
    pass_number : int
        n, from 0.
    """

    def __init__(self, geometry: Geometry, pass_number: int):
        self._lib, self._first = arrays_of(mi.Float), pass_number == 0
        self._changes = loses_coherence(geometry, pass_number)
        self._pass = dr.opaque(mi.UInt32, pass_number)

    def of(self, first: mi.UInt32, second: mi.UInt32, point: dr.ArrayBase, normal: mi.Vector3f, shape: mi.ShapePtr,
           primitive: mi.UInt32, uv: mi.Point2f) -> tuple[mi.Float, mi.Float]:
        """Give a_n.

        Parameters
        ----------
        first, second : UInt32 (R,)
            Hashes of the scatterers.
        point, normal, shape, primitive, uv
            As of `scene.materials.coherence`.

        Returns
        -------
        real, imaginary : Float (R,)
        """
        own = gaussian(self._lib, first, second)
        if not self._changes:
            return own
        kept = coherence(point, normal, shape, primitive, uv)
        if self._first:
            kept = dr.select(kept > 0, kept, 1)
        # the second hash is made of the first, and would take its bits out again
        of_pass = gaussian(self._lib, *hashed_pair(self._lib, first, mi.UInt32(Salt.OF_ONE_PASS), self._pass))
        a, b = dr.sqrt(kept), dr.sqrt(1 - kept)
        return a * own[0] + b * of_pass[0], a * own[1] + b * of_pass[1]
