"""Echoes with a phase of their own in a block of pings: of point targets and smooth surfaces, as the sonar meets them.

    a_i = e_i e^(-i2πf₀τ_i)

e_i and τ_i -> amplitude of an echo (`echoes.record`) and the delay at which the moving sonar receives it (`underway`).
`coherent_sides` and `coherent_beams` weight a_i by the beams of a row.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.types import Vector
from mitsonar.echoes.point_targets import PointTargets
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.smooth.targets import SmoothTargets
from mitsonar.scattering.bodies.echo_taps import ReceivedBand
from mitsonar.sonar.pulses.pulse import Pulse

from ..motion.places import Place
from .sound_paths import SoundPaths

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


@dataclass(frozen=True, kw_only=True)
class PhasedArrivals:
    """Echoes of one kind at the sonar, on the device."""

    number: mi.UInt32  # (R,): of the ping, counted from the first of a group
    ping: mi.UInt32  # (R,): number of the ping in the block
    label: mi.UInt32  # (R,)
    echoes: Echoes
    delay: mi.Float64  # (R,) [s]: from the transmission to the reception
    towards: Vector  # (R,): direction of the reception
    real: mi.Float  # (R,): of a_i
    imaginary: mi.Float  # (R,)


class PhasedEchoes:
    """Point targets and smooth surfaces around a sonar."""
    # frequency [Hz]; resolution, farthest [m]; drift [-], of `Underway`; mirrored: targets also by way of the surface

    def __init__(self, sound: SoundPaths, *, frequency: float, band: ReceivedBand, resolution: float, farthest: float,
                 drift: float, mirrored: bool):
        self.sights, self._mirrored = sound.sights, mirrored
        self._targets = PointTargets.of(sound.geometry, band, sound.water.profile)
        self._smooth = SmoothTargets(sound.sights, frequency=frequency, resolution=resolution, reach=0.0, drift=drift,
                                     farthest=farthest)
        self._frequency = dr.opaque(mi.Float64, frequency)

    def __bool__(self) -> bool:
        """Return True if the scene has such echoes."""
        return bool(self._smooth or self._targets)

    def of(self, place: Place, first: int, end: int,
           within: Callable[..., np.ndarray] | None = None) -> Iterator[PhasedArrivals]:
        """Yield the arrivals of the pings from `first` to before `end` of a block; `within` chooses smooth facets."""
        if self._targets:
            pings, count = end - first, dr.opaque(mi.UInt32, len(self._targets))
            index = dr.arange(mi.UInt32, pings * len(self._targets))
            number = index // count
            ping, which = number + dr.opaque(mi.UInt32, first), index - number * count
            for echoes, _ in self._targets.echoes(self.sights, place.sources, place.origin(ping), place.source(ping),
                                                  which, mirrored=self._mirrored):
                yield self.received(place, first, number, self._targets.label(which), echoes)
        if self._smooth:
            for number, label, echoes in self._smooth.echoes(
                    place.sources, place.position[first:end], place.source_of[first:end], within):
                yield self.received(place, first, number, label, echoes)

    def received(self, place: Place, first: int, number: mi.UInt32, label: mi.UInt32,
                 echoes: Echoes) -> PhasedArrivals:
        """Return the arrivals of echoes of the pings `number`, counted from `first`."""
        ping = number + dr.opaque(mi.UInt32, first)
        still = echoes.out.travel_time + echoes.between + echoes.back.travel_time
        received = place.receive(ping, echoes.back.sent_towards, echoes.back.offset, still)
        cycles = received.delay * self._frequency
        sine, cosine = dr.sincos(mi.Float(cycles - dr.floor(cycles)) * float(-2 * np.pi))
        real, imaginary = echoes.amplitude
        return PhasedArrivals(number=number, ping=ping, label=label, echoes=echoes, delay=received.delay,
                              towards=received.towards, real=real * cosine - imaginary * sine,
                              imaginary=real * sine + imaginary * cosine)
