"""Points as a sonar sees them: straight, and by way of a flat surface that mirrors.

An echo of a point under a mirror went out by one of the two and comes back by one of the two:

    e = f √(g_out g_back) (-1)^m

m ways by the mirror, whose reflection is -1, f the point's pressure at 1 m from the one towards the other, g the gain
of a leg (`sonar_equation`). By way of the mirror the sonar stands at its image, in water unfolded about the surface
(`tracing.water`). By way of the bed it is seen by `bed_mirror`.
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.tracing.connection import Connection, Connector
from mitsonar.scene.tracing.tracer import Sources

from ..record import Echoes, Leg
from ..sonar_equation import leg_gain, mirrored_overhead, speed_ratio
from .bed_mirror import BedMirror
from .sight import Sight

__all__ = ["Sights"]

JUST_BELOW = 1e-4                  # [m] where the surface is met from below


class Sights:
    """See points from sonars.

    Parameters
    ----------
    connector : Connector
    max_depth : int
        Bounces that an echo may have made.
    frequency : float or None [Hz]
        None: targets are not seen by way of the bed.

    Attributes
    ----------
    mirror : bool
        Whether the surface is flat and mirrors.
    bed : BedMirror or None
        How targets are seen by way of the bed; None: not at all.
    """

    def __init__(self, connector: Connector, *, max_depth: int, frequency: float | None = None):
        self.connector, self.max_depth = connector, max_depth
        self.geometry, self.water = connector.geometry, connector.water
        self.lib, self.mirror = arrays_of(mi.Float), connector.geometry.surface_mirrors
        bed = BedMirror(connector, frequency) if frequency is not None and max_depth > 1 else None
        self.bed = bed if bed is not None and bed.planes else None

    def see(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase,
            normal: mi.Vector3f, *, folded: bool = False, short: float = 0.0) -> Sight:
        """See one point an entry.

        Parameters
        ----------
        sources, origin, source, point, normal, short
            As of `Connector.connect`.
        folded : bool
            By way of the mirror.

        Returns
        -------
        Sight
        """
        if folded:
            start = origin + dr.zeros(type(origin), dr.width(point))
            way = self.connector.join(start, mi.Vector3f(0, 0, 0), point, normal, folded=True, short=short)
        else:
            way = self.connector.connect(sources, origin, source, point, normal, short=short)
        return self.along(sources, origin, source, point, way, folded=folded)

    def along(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, point: dr.ArrayBase, way: Connection,
              *, folded: bool = False) -> Sight:
        """See points along ways that are known."""
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=ratio,
                        loss_db=self.water.loss_db(origin, point, way, folded))
        start = type(origin)(origin.x, origin.y, -origin.z) if folded else origin
        return Sight(way=way, leg=Leg.along(way, start, point, folded=folded), gain=gain)

    def ways(self, bounces: int = 1) -> Iterator[tuple[bool, bool, float]]:
        """How an echo of so many bounces may go by the mirror besides: there or not, back or not, and its sign."""
        if self.mirror:
            for there, back in ((False, True), (True, False), (True, True)):
                if bounces + there + back <= self.max_depth:
                    yield there, back, 1.0 if there == back else -1.0

    def bed_ways(self, bounces: int = 1) -> Iterator[tuple[str, str]]:
        """How an echo of so many bounces may go by the bed: what it goes by there and back, "", "s" or "b"."""
        if self.bed is None:
            return
        others = ("", "s", "b") if self.mirror else ("", "b")
        for there in others:
            for back in others:
                if "b" in there + back and bounces + len(there + back) <= self.max_depth:
                    yield there, back

    def overhead(self, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32) -> tuple[Echoes, mi.Bool]:
        """The echo of a mirror straight above: half the pressure of a wave that comes from a point there.

        Returns
        -------
        Echoes
            Of the path "s".
        free : Bool (R,)
        """
        point = self.lib.Array3f64(origin.x, origin.y, -JUST_BELOW)
        sight = self.see(sources, origin, source, point, mi.Vector3f(0, 0, 0))
        way, nothing = sight.way, dr.zeros(mi.Float, dr.width(sight.gain))
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        pressure = mirrored_overhead(sight.gain, spreading_area=way.spreading_area, speed_ratio=ratio)
        return Echoes(out=sight.leg, back=sight.leg, between=dr.zeros(mi.Float64, dr.width(nothing)),
                      energy=dr.square(pressure), amplitude=(pressure, nothing), path="s"), way.free
