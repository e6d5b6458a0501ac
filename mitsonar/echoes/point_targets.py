"""Point targets: scatterers with a target strength in place of an area, and no chance in their phase.

A target answers with the pressure f = 10^(TS/20) along every leg, straight, by way of a flat surface (`sights`) or of
the bed (`bed_mirror`). It may lie on a surface, which must not hide it.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..tracing.tracer import Sources
from .record import Echoes
from .sight import path_of, product
from .sights import Sights
from .sonar_equation import pressure_along_legs

__all__ = ["TARGET_RADIUS", "PointTargets"]

TARGET_RADIUS = 0.02               # [m] about a point target within which nothing hides it


class PointTargets:
    """The point targets of a scene, on the device.

    Parameters
    ----------
    targets : sequence of (position (3,) [m], strength [dB re 1 m²], label)
        As `Geometry.targets` gives them.
    """

    def __init__(self, targets: Sequence[tuple]):
        self.lib, self.count = arrays_of(mi.Float), len(targets)
        if not targets:
            return
        position, strength_db, label = (np.array(column) for column in zip(*targets))
        self._position = [upload(mi.Float64, axis) for axis in position.T]
        self._pressure = upload(mi.Float, (10 ** (strength_db / 20)).astype(np.float32))
        self._label = upload(mi.UInt32, label.astype(np.uint32))

    def __len__(self) -> int:
        return self.count

    def position(self, which: mi.UInt32) -> dr.ArrayBase:
        """Array3f64 (R,) [m]."""
        return self.lib.Array3f64(*(dr.gather(mi.Float64, axis, which) for axis in self._position))

    def pressure(self, which: mi.UInt32) -> mi.Float:
        """f, Float (R,) [m]."""
        return dr.gather(mi.Float, self._pressure, which)

    def label(self, which: mi.UInt32) -> mi.UInt32:
        """Numbers of their shapes, UInt32 (R,)."""
        return dr.gather(mi.UInt32, self._label, which)

    def drawn(self, share: mi.Float) -> tuple[mi.UInt32, mi.Float]:
        """Draw targets evenly, by numbers in [0, 1): which, and their strengths f² over the chance of that [m²]."""
        count = dr.opaque(mi.UInt32, self.count)
        which = dr.minimum(mi.UInt32(share * mi.Float(count)), count - 1)
        return which, mi.Float(count) * dr.square(self.pressure(which))

    def echoes(self, sights: Sights, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, which: mi.UInt32, *,
               mirrored: bool = True) -> Iterator[tuple[Echoes, mi.Bool]]:
        """Give the echoes of targets seen from sources, one pair an entry.

        Parameters
        ----------
        sights : Sights
        sources, origin, source
            As of `Connector.connect`.
        which : UInt32 (R,)
            Numbers of the targets.
        mirrored : bool
            Give those by way of the mirror and of the bed as well, where these are.

        Yields
        ------
        echoes : Echoes
            Straight ones, then those of each way by the mirror, then by the bed. Their pressure is 0 where something
            hides them.
        free : Bool (R,)
            Whether nothing does.
        """
        point, strength = self.position(which), self.pressure(which)
        ways = [(False, False, 1.0), *(sights.ways() if mirrored else ())]
        ends = {folded: sights.see(sources, origin, source, point, mi.Vector3f(0, 0, 0), folded=folded,
                                   short=TARGET_RADIUS) for folded in {back for _, back, _ in ways}}
        nothing = dr.zeros(mi.Float, dr.width(strength))
        for there, back, sign in ways:
            out, home = ends[there], ends[back]
            pressure = pressure_along_legs(strength, out.gain, home.gain) * sign
            free = out.way.free & home.way.free & dr.isfinite(pressure)
            pressure = dr.select(free, pressure, 0)
            yield Echoes(out=out.leg, back=home.leg, between=dr.zeros(mi.Float64, dr.width(pressure)),
                         energy=dr.square(pressure), amplitude=(pressure, nothing),
                         path=("b", "bs", "sbs")[there + back]), free
        if mirrored and sights.bed is not None:
            yield from self._by_the_bed(sights, sources, origin, source, which, point, strength)

    def _by_the_bed(self, sights, sources, origin, source, which, point, strength):
        """Echoes by way of the bed, there, back or both."""
        nothing, seen = mi.Vector3f(0, 0, 0), {}
        for there, back in sights.bed_ways():
            for by in (there, back):
                if by == "b" and by not in seen:
                    seen[by] = sights.bed.see(sources, origin, source, point, nothing, self.label(which),
                                              short=TARGET_RADIUS)
                elif by not in seen:
                    seen[by] = sights.see(sources, origin, source, point, nothing, folded=by == "s",
                                          short=TARGET_RADIUS)
            out, home = seen[there], seen[back]
            (real, imaginary), later = product(out, home)
            pressure = pressure_along_legs(strength, out.gain, home.gain) * (-1.0 if "s" in there + back else 1.0)
            free = out.way.free & home.way.free & dr.isfinite(pressure)
            amplitude = dr.select(free, pressure * real, 0), dr.select(free, pressure * imaginary, 0)
            leg = home.leg if there != back else replace(home.leg)        # another one: the time between counts
            energy = dr.square(amplitude[0]) + dr.square(amplitude[1])
            yield Echoes(out=out.leg, back=leg, between=later, energy=energy, amplitude=amplitude,
                         path=path_of(there, back)), free
