"""Echoes of point targets, seen straight and by way of a flat surface."""
from __future__ import annotations

from collections.abc import Iterator, Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..echoes.record import Echoes
from ..echoes.scatterers import TARGET_RADIUS
from ..echoes.sights import Sights
from ..echoes.sonar_equation import pressure_along_legs
from .places import Place

__all__ = ["target_echoes"]


def target_echoes(sights: Sights, targets: Sequence[tuple], place: Place, pings: int, first: int,
                  mirrored: bool = True) -> Iterator[tuple]:
    """Yield the numbers of pings (from `first` on 0), of shapes, and the echoes of every target."""
    lib = arrays_of(mi.Float)
    position, strength_db, label = (np.array(column) for column in zip(*targets))
    index = dr.arange(mi.UInt32, pings * len(position))
    number = index // dr.opaque(mi.UInt32, len(position))
    which = index - number * dr.opaque(mi.UInt32, len(position))
    ping = number + dr.opaque(mi.UInt32, first)
    point = lib.Array3f64(*(dr.gather(mi.Float64, upload(mi.Float64, axis), which) for axis in position.T))
    origin, source = place.origin(ping), place.source(ping)
    strength = dr.gather(mi.Float, upload(mi.Float, (10 ** (strength_db / 20)).astype(np.float32)), which)
    label = dr.gather(mi.UInt32, upload(mi.UInt32, label.astype(np.uint32)), which)
    ways = [(False, False, 1.0), *(sights.ways() if mirrored else ())]
    # it may lie on a surface, which must not hide it
    ends = {folded: sights(place.sources, origin, source, point, mi.Vector3f(0, 0, 0), folded=folded,
                           short=TARGET_RADIUS)
            for folded in {back for _, back, _ in ways}}
    nothing = dr.zeros(mi.Float, dr.width(strength))
    for there, back, sign in ways:
        out, home = ends[there], ends[back]
        pressure = pressure_along_legs(strength, out.gain, home.gain) * sign
        pressure = dr.select(out.way.free & home.way.free & dr.isfinite(pressure), pressure, 0)
        yield number, label, Echoes(
            out=out.leg, back=home.leg, between=dr.zeros(mi.Float64, dr.width(pressure)),
            energy=dr.square(pressure), amplitude=(pressure, nothing), path=("b", "bs", "sbs")[there + back])
