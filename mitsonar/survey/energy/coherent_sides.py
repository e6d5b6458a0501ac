"""Coherent echoes of a sidescan: smooth surfaces, point targets, and a flat sea surface.

    a_i = 10^(SL/20) b_t b_r e_i e^(-i2πf₀τ_i)

e_i and τ_i -> amplitude and delay of an echo (`echoes.record`, `underway`); b_t -> pressure pattern of the transmitting
face at the transmission, b_r -> that of the receiving face at the reception. The echoes' pulses are summed as pressures
(`coherent_pulses`).

Under a surface that mirrors, targets are also seen by way of it (`echoes.sights`). Both sides share the surface's own
echo, from straight above: half to each, or by Fresnel's integral where the platform rolls.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import scipy

from mitsonar.device.arrays import upload
from mitsonar.imaging.energy_record import CoherentSums, joined

from ..motion.places import Place
from .coherent_pulses import CoherentPulses, PulseArrivals
from .face_beams import BEAM_EDGE, FaceBeams
from .phased_echoes import PhasedArrivals, PhasedEchoes, band_of_tone
from .sidescan_survey import SidescanSurvey
from .sound_paths import SoundPaths

FAINT = 1e-7                       # two-way intensity of the beams' envelope below which facets are left out


class CoherentSides:
    """Sums of the coherent echoes of a sidescan's sides."""

    def __init__(self, survey: SidescanSurvey, sound: SoundPaths, beams: FaceBeams, *, drift: float, shift: float):
        self._survey, self._beams, self._shift = survey, beams, shift
        sonar, end = survey.sonar, survey.window[1] + survey.sonar.pulse_length
        self._phased = PhasedEchoes(
            sound, frequency=sonar.frequency, band=band_of_tone(sonar.frequency, sonar.pulse_length), drift=drift,
            resolution=0.5 * sonar.sound_speed * sonar.pulse_length, mirrored=True,
            farthest=0.5 * end * sound.water.fastest * (1 + 0.5 * drift))
        self._sights, self._pulses = sound.sights, CoherentPulses(survey)
        self._source_pressure = dr.opaque(mi.Float, 10 ** (sonar.source_level_db / 20))

    @property
    def silent(self) -> bool:
        """Return True if the scene has no coherent echoes."""
        return not (self._phased or self._sights.mirror)

    def sum(self, place: Place) -> CoherentSums:
        """Return the sums of the echoes of a block of pings; arrays (rows, ..., bins)."""
        pings, size = len(place.ping), self._pulses.pings_at_once
        return joined([self._group(place, first, min(first + size, pings)) for first in range(0, pings, size)])

    def _group(self, place: Place, first: int, end: int) -> CoherentSums:
        """Return the sums of the pings from `first` to before `end` of a block."""
        blocks = [arrivals for arrivals in self._arrivals(place, first, end) if len(arrivals.row)]
        rows = 2 * (end - first)
        return self._pulses.sum(blocks, rows) if blocks else self._pulses.silence(rows)

    def _arrivals(self, place: Place, first: int, end: int) -> Iterator[PulseArrivals]:
        """Yield the echoes within the record as the faces receive them; pings count from `first`."""
        position, rotation = place.position[first:end], place.rotation[first:end]
        if self._sights.mirror:
            for echoes, side in self._overhead(place, position, rotation, first):
                yield self._at_faces(place, echoes, side)
        for echoes in self._phased.of(place, first, end, self._within_beams(position, rotation)):
            yield self._at_faces(place, echoes)

    def _within_beams(self, position: np.ndarray, rotation: np.ndarray) -> Callable[..., np.ndarray]:
        """Return a function that keeps facets within the envelope of the side lobes along the platform."""
        sonar = self._survey.sonar
        faces = ((sonar.transmit, 0.0), (sonar.receive, self._shift))

        def choose(number: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
            towards = (centre - position[number]) @ rotation[number]
            distance = np.linalg.norm(towards, axis=1)
            u = np.maximum(np.abs(towards[:, 0]) - radius, 0) / np.maximum(distance, 1e-9)
            pressure = np.prod([face.along_shape.envelope(np.maximum(u - turned, 0), face.length / sonar.wavelength)
                                for face, turned in faces], axis=0)
            return pressure ** 2 > FAINT

        return choose

    def _overhead(self, place: Place, position: np.ndarray, rotation: np.ndarray,
                  first: int) -> Iterator[tuple[PhasedArrivals, float]]:
        """Yield the echo of a flat surface, as the faces of either side receive it."""
        number = dr.arange(mi.UInt32, len(position))
        ping = number + dr.opaque(mi.UInt32, first)
        echoes, free = self._sights.overhead(place.sources, place.origin(ping), place.source(ping))
        # distance from straight above at which the platform's middle plane meets the surface, in Fresnel's units below
        height, up = np.maximum(-position[:, 2], 1e-3), rotation[:, 2]
        aside = height * up[:, 1] / np.maximum(np.hypot(up[:, 0], up[:, 2]), 1e-9)
        sine, cosine = scipy.special.fresnel(aside * np.sqrt(4 / (self._survey.sonar.wavelength * height)))
        starboard = 0.5 + (cosine - 1j * sine) / (1 - 1j)
        label = dr.full(mi.UInt32, self._survey.world.surface_label, len(position))
        for side, share in ((-1.0, 1 - starboard), (1.0, starboard)):
            real, imaginary = (upload(mi.Float, part.astype(np.float32)) for part in (share.real, share.imag))
            pressure = dr.select(free, echoes.amplitude[0], 0)
            shared = replace(echoes, amplitude=(pressure * real, pressure * imaginary))
            yield self._phased.received(place, first, number, label, shared), side

    def _at_faces(self, place: Place, arrivals: PhasedArrivals, side: float | None = None) -> PulseArrivals:
        """Return arrivals within the record as the faces receive them.

        `side` is -1 for the port face, 1 for starboard, and None for the side that each echo comes from.
        """
        echoes, ping = arrivals.echoes, arrivals.ping
        pressure, along, sides, cosines = self._source_pressure, mi.Float(1), [], []
        for towards, face in ((echoes.out.sent_towards, self._beams.transmit),
                              (arrivals.towards, self._beams.receive)):
            body = place.body(ping, towards)
            along *= face.along.pressure(body.x)
            pressure = pressure * face.across.pressure(self._beams.across(body))
            sides.append(body.y > 0 if side is None else dr.full(mi.Bool, side > 0, dr.width(body)))
            cosines.append(body.x)
        lobe = along
        if not place.still:
            # half-way between the lobes, see `FaceBeams.lobe`
            half = 0.5 * (cosines[1] - place.body(ping, echoes.back.sent_towards).x)
            lobe = (self._beams.transmit.along.pressure(cosines[0] + half)
                    * self._beams.receive.along.pressure(cosines[1] - half))
        pressure = pressure * along
        start = place.origin(ping).z
        depth = -mi.Float((-start if echoes.back.folded else start) + echoes.back.offset.z)
        row = 2 * arrivals.number + dr.select(sides[0], mi.UInt32(1), mi.UInt32(0))
        columns = {"row": row, "label": arrivals.label, "delay": arrivals.delay, "real": arrivals.real * pressure,
                   "depth": depth, "imaginary": arrivals.imaginary * pressure, "in_beam": lobe * lobe > BEAM_EDGE,
                   "same_side": sides[0] == sides[1]}
        dr.eval(columns)
        return self._within_record({name: column.numpy() for name, column in columns.items()}, echoes.path)

    def _within_record(self, columns: dict[str, np.ndarray], path: str) -> PulseArrivals:
        """Return arrivals that are not zero, lie within the record and return to the side that they left from."""
        half, window = 0.5 * self._survey.sonar.pulse_length, self._survey.window
        delay = columns["delay"]
        good = columns["same_side"] & (delay >= window[0] - half) & (delay < window[1] + half)
        good &= (columns["real"] != 0) | (columns["imaginary"] != 0)
        number = self._survey.paths.number(path) - 1
        return PulseArrivals(path=np.full(np.count_nonzero(good), number),
                         **{name: column[good] for name, column in columns.items() if name != "same_side"})
