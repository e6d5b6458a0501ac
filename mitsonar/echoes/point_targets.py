"""Point targets: scatterers with a target strength in place of an area, and no chance in their phase.

A target answers with the pressure f = 10^(TS/20) along every leg, straight or by way of a flat surface (`sights`). It
may lie on a surface, which must not hide it.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..tracing.tracer import Sources
from .record import Echoes
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
            Give those by way of the mirror as well, where there is one.

        Yields
        ------
        echoes : Echoes
            Straight ones, and then those of each way by the mirror. Their pressure is 0 where something hides them.
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
