"""Echoes of point targets in a block of pings, seen straight and by way of a flat surface."""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi

from mitsonar.echoes.point_targets import PointTargets
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.sights.sights import Sights
from mitsonar.scattering.bodies.echo_taps import ReceivedBand
from mitsonar.sonar.pulses.pulse import Pulse

from ..motion.places import Place

HALF_POWER = 0.443                 # half-power frequency of a tone from its carrier, over 1 / length
SKIRTS = 4.3                       # `Pulse.suggested_sampling_rate` of a tone, over 1 / length


def band_of(pulse: Pulse) -> ReceivedBand:
    """Return the pulse's band, including the skirts of its spectrum that the samples keep."""
    return ReceivedBand(frequency=pulse.frequency, low=pulse.frequency + pulse.band[0],
                     high=pulse.frequency + pulse.band[1], width=pulse.suggested_sampling_rate)


def band_of_tone(frequency: float, length: float) -> ReceivedBand:
    """Return the band of a tone from its frequency [Hz] and length [s]; see `band_of`."""
    return ReceivedBand(frequency=frequency, low=frequency - HALF_POWER / length, high=frequency + HALF_POWER / length,
                     width=SKIRTS / length)


def target_echoes(sights: Sights, targets: PointTargets, place: Place, pings: int, first: int,
                  mirrored: bool = True) -> Iterator[tuple[mi.UInt32, mi.UInt32, Echoes]]:
    """Yield the numbers of pings (0 is `first`), the labels of shapes, and the echoes of every target."""
    index, count = dr.arange(mi.UInt32, pings * len(targets)), dr.opaque(mi.UInt32, len(targets))
    number = index // count
    ping, which = number + dr.opaque(mi.UInt32, first), index - number * count
    for echoes, _ in targets.echoes(sights, place.sources, place.origin(ping), place.source(ping), which,
                                    mirrored=mirrored):
        yield number, targets.label(which), echoes
