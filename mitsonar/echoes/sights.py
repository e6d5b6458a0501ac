"""Points as a sonar sees them: straight, and by way of a flat surface that mirrors.

What is heard of a point under a mirror went out by one of the two and comes back by one of the two:

    e = f √(g_out g_back) (-1)^m,    g = (c_h / c_0) 10^(-ᾱ L / 10) / A

m ways by the mirror, whose reflection is -1, f the point's pressure at 1 m from the one towards the other, g what
a way is worth; symbols as in `signal.echoes`. By way of the mirror the sonar stands at its image, in water unfolded
about the surface (`free_rays`).
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from ..device.arrays import arrays_of
from .record import Echoes, Leg
from .sonar_equation import leg_gain, mirrored_overhead, speed_ratio

__all__ = ["Sight", "Sights"]

JUST_BELOW = 1e-4                  # [m] where the surface is met from below


@dataclass(frozen=True, kw_only=True)
class Sight:
    """How points are seen, one an entry.

    Attributes
    ----------
    way : connection.Connection
    leg : Leg
    gain : Float (R,) [1/m²]
        g.
    """

    way: object
    leg: Leg
    gain: object


class Sights:
    """See points from sonars.

    Parameters
    ----------
    connector : connection.Connector
    free_rays : FreeRays
    loss_db, folded_db : callable
        As `signal.echoes.Absorption`, of the water and of the water unfolded; the second is None where nothing mirrors.
    max_depth : int
        Bounces that an echo may have made.

    Attributes
    ----------
    mirror : bool
        Whether the surface does.
    """

    def __init__(self, connector, free_rays, loss_db, folded_db, *, max_depth):
        self.connector, self.free_rays, self.loss_db, self.folded_db = connector, free_rays, loss_db, folded_db
        self.lib, self.max_depth, self.mirror = arrays_of(mi.Float), max_depth, folded_db is not None

    def __call__(self, sources, origin, source, point, normal, *, folded=False, short=0.0):
        """See one point an entry.

        Parameters
        ----------
        sources, origin, source, point, normal, short
            As of `connection.Connector`.
        folded : bool
            By way of the mirror.

        Returns
        -------
        Sight
        """
        if not folded:
            return self.of(sources, origin, source, point, self.connector(sources, origin, source, point, normal,
                                                                          short=short))
        start = origin + dr.zeros(type(origin), dr.width(point))
        way = self.free_rays.connect(start, mi.Vector3f(0, 0, 0), point, normal, folded=True, short=short)
        loss_db = self.folded_db(mi.Float(origin.z), mi.Float(-point.z), way.arc_length, mi.Float(way.ray_parameter))
        return self._sight(sources, source, type(origin)(origin.x, origin.y, -origin.z), point, way, loss_db, True)

    def of(self, sources, origin, source, point, way):
        """How points are seen along straight ways, that are known."""
        loss_db = self.loss_db(mi.Float(-origin.z), mi.Float(-point.z), way.arc_length, mi.Float(way.ray_parameter))
        return self._sight(sources, source, origin, point, way, loss_db, False)

    def _sight(self, sources, source, origin, point, way, loss_db, folded):
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=ratio, loss_db=loss_db)
        return Sight(way=way, leg=Leg.along(way, origin, point, folded=folded), gain=gain)

    def ways(self, bounces=1):
        """How an echo of so many bounces may go by the mirror besides: (there, back, sign), there and back bool."""
        if self.mirror:
            for there, back in ((False, True), (True, False), (True, True)):
                if bounces + there + back <= self.max_depth:
                    yield there, back, 1.0 if there == back else -1.0

    def overhead(self, sources, origin, source):
        """The echo of a mirror straight above: half the pressure of a wave that comes from a point there.

        Returns
        -------
        Echoes
            Of the path "s".
        free : Bool (R,)
        """
        point = self.lib.Array3f64(origin.x, origin.y, -JUST_BELOW)
        sight = self(sources, origin, source, point, mi.Vector3f(0, 0, 0))
        way, nothing = sight.way, dr.zeros(mi.Float, dr.width(sight.gain))
        ratio = speed_ratio(way.sound_speed, sources.state.gather(self.lib, source)[1])
        pressure = mirrored_overhead(sight.gain, spreading_area=way.spreading_area, speed_ratio=ratio)
        return Echoes(out=sight.leg, back=sight.leg, between=dr.zeros(mi.Float64, dr.width(nothing)),
                      energy=dr.square(pressure), amplitude=(pressure, nothing), path="s"), way.free
