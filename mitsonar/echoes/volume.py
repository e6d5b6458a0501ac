"""Echoes of the water itself: points drawn in the volume, each connected to the sonar along its bent ray.

    p² = 10^(SL/10) B s_v(z) dV (c_v / c_0)² 10^(-2 ᾱ L / 10) / A²,       dV = r² ΔΩ dr

The point lies at r along a straight line from the sonar, for which dV is exact; how sound gets there, and whether it
does, is the eigenray's to say (A its spreading area; symbols as in `signal.echoes`). Distances of a row are a lattice
over all its directions, shifted as a whole by chance: gates of time get their share of points almost without chance,
and other points every ping.
"""
from dataclasses import dataclass
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from ..tracing.connection import Connection
from ..water.volume_table import volume_table
from .sonar_equation import along_legs, leg_gain, speed_ratio

__all__ = ["WaterEchoes"]

GOLDEN = 0.6180339887498949
NEAREST = 0.25                     # [m]: what is nearer is no far field, and rings as long as the pulse is sent
NEARER, FARTHER = 0.97, 1.03       # of the window's straight ranges: rays bend


@dataclass(frozen=True, kw_only=True)
class _Drawn:
    """Points of the water and their echoes.

    Attributes
    ----------
    point : Array3f64 (R,) [m]
    way : Connection
    energy : Float (R,)
        p² relative to 10^(SL/10), without B and absorption [1/m²].
    loss_db : Float (R,)
        Two-way absorption.
    active : Bool (R,)
    """

    point: object
    way: Connection
    energy: object
    loss_db: object
    active: object


class WaterEchoes:
    """Draw what a stratified volume sends back.

    Parameters
    ----------
    volume : water.VolumeScattering
    connector : Connector
    absorption : signal.echoes.Absorption
    window : (float, float) [s]
        Two-way times.
    """

    def __init__(self, volume, connector, absorption, window):
        self.table = volume_table(volume, mi.Float)
        self.connector, self.absorption = connector, absorption
        speed = np.asarray(connector.tracer.profile.sound_speed)
        near, far = 0.5 * window[0] * speed.min() * NEARER, 0.5 * window[1] * speed.max() * FARTHER
        near, far = max(near, NEAREST), max(far, 2 * NEAREST)
        self.near, self.span = dr.opaque(mi.Float, near), dr.opaque(mi.Float, far - near)

    def __call__(self, sources, origin, source, source_speed, direction, solid_angle, strata, chance):
        """Draw one point along each direction.

        Parameters
        ----------
        sources, origin, source
            As of `Connector`.
        source_speed : Float (R,) [m/s]
        direction : Vector3f (R,)
            Unit.
        solid_angle : Float (R,) [sr]
            That each direction stands for.
        strata : Strata
            How the rays are numbered.
        chance : Float (R,)
            In [0, 1), independent, and another for every ping.

        Returns
        -------
        _Drawn
        """
        row, within, _, _ = strata.split(dr.arange(mi.UInt32, strata.rays))
        first = dr.gather(mi.Float, chance, row * strata.per_row)
        count = strata.shape[0] * strata.shape[1]
        step = _coprime(count)
        turn = mi.UInt32(mi.UInt64(within) * dr.opaque(mi.UInt64, step) % dr.opaque(mi.UInt64, count))
        place = (mi.Float(turn) + chance) / mi.Float(strata.per_row) + first
        r = self.near + self.span * (place - dr.floor(place))
        point = origin + type(origin)(direction * r)
        in_water = point.z < 0
        way = self.connector(sources, origin, source, point, mi.Vector3f(0, 0, 0), in_water)
        strength = self.table(mi.Float(-point.z), in_water)
        gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=speed_ratio(way.sound_speed, source_speed))
        energy = along_legs(strength * r * r * solid_angle * self.span, gain, gain)
        loss_db = self.absorption(mi.Float(-origin.z), mi.Float(-point.z), way.arc_length, mi.Float(way.ray_parameter))
        return _Drawn(point=point, way=way, energy=energy, loss_db=loss_db,
                      active=in_water & way.free & (energy > 0) & dr.isfinite(energy))


def _coprime(count):
    """A whole number near the golden share of `count` that has no divisor in common with it."""
    step = max(1, round(GOLDEN * count))
    while gcd(step, count) > 1:
        step += 1
    return step
