"""Echoes of point targets in a block of pings, seen straight and by way of a flat surface."""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from ..echoes.point_targets import PointTargets
from ..echoes.record import Echoes
from ..echoes.sights import Sights
from .places import Place

__all__ = ["target_echoes"]


def target_echoes(sights: Sights, targets: PointTargets, place: Place, pings: int, first: int,
                  mirrored: bool = True) -> Iterator[tuple[mi.UInt32, mi.UInt32, Echoes]]:
    """Yield the numbers of pings (from `first` on 0), of shapes, and the echoes of every target."""
    index, count = dr.arange(mi.UInt32, pings * len(targets)), dr.opaque(mi.UInt32, len(targets))
    number = index // count
    ping, which = number + dr.opaque(mi.UInt32, first), index - number * count
    for echoes, _ in targets.echoes(sights, place.sources, place.origin(ping), place.source(ping), which,
                                    mirrored=mirrored):
        yield number, targets.label(which), echoes
