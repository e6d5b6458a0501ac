"""Coherent echoes of targets and smooth surfaces, as the beams of an array or of a rotating head receive them.

Pressures of an instance in a bin add, and are then squared. The pulse and the beams' side lobes blur these squares like
all energies (`array_beams`); the picture itself takes its pressures from the elements' signals.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.types import Vector
from mitsonar.echoes.point_targets import PointTargets
from mitsonar.echoes.record import Echoes
from mitsonar.echoes.smooth.targets import SmoothTargets
from mitsonar.imaging.energy_record import CoherentRecord, CoherentSums

from ..motion.places import Place
from ..pressure.array_survey import ArraySurvey
from .energy_bins import EnergyBins
from .sound_paths import SoundPaths
from .target_echoes import band_of, target_echoes

FLAT_BAND = 0.75                   # c / 2B of the two thirds of a sampled band that are used, over c / 2 a sample


class BeamsOfPings(Protocol):
    """Beams that receive echoes."""

    count: int  # beams of a ping

    def receive(self, place: Place, ping: mi.UInt32, sent: Vector,
                towards: Vector) -> tuple[mi.UInt32, mi.Float]:
        """Return the beam that receives each echo, and its two-way intensity; see `array_beams.ArrayBeams`."""
        ...

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return intensities (rows, ..., bins) as the picture shows them."""
        ...


class CoherentBeams:
    """Coherent echoes that beams of an array receive."""

    def __init__(self, survey: ArraySurvey, sound: SoundPaths, beams: BeamsOfPings, bins: EnergyBins, *, drift: float):
        self._sights, self._beams, self._bins = sound.sights, beams, bins
        self._labels, self._targets = len(survey.labels), PointTargets(
            sound.geometry.targets(), band_of(survey.pulse), sound.water.profile)
        self._smooth = SmoothTargets(
            sound.sights, frequency=survey.frequency, reach=0.0, drift=drift,
            resolution=FLAT_BAND * survey.planned_speed / survey.sampling_rate, farthest=sound.tracer.max_range)
        self._source_power = 10 ** (survey.source_level_db / 10)
        self._frequency = dr.opaque(mi.Float64, survey.frequency)

    @property
    def silent(self) -> bool:
        """Return True if the scene has no coherent echoes."""
        return not (self._smooth or self._targets)

    def sum(self, place: Place) -> CoherentSums:
        """Sum the echoes of a block of pings; arrays (pings x beams, ..., bins)."""
        shape = len(place.ping) * self._beams.count, self._labels, self._bins.count
        real_sum, imaginary_sum = np.zeros(shape), np.zeros(shape)
        for ping, label, echoes in self._echoes(place):
            delay = echoes.out.travel_time + echoes.between + echoes.back.travel_time
            received = place.receive(ping, echoes.back.sent_towards, echoes.back.offset, delay)
            row, pattern = self._beams.receive(place, ping, echoes.out.sent_towards, received.towards)
            bin, inside = self._bins.of(received.delay, pattern > 0)
            cycles = received.delay * self._frequency
            phase = mi.Float(cycles - dr.floor(cycles)) * (2 * np.pi)
            row = ping * self._beams.count + row
            columns = row, label, bin, inside, dr.sqrt(pattern), phase, *echoes.amplitude
            dr.eval(columns)
            row, label, bin, inside, root, phase, real, imaginary = (
                np.broadcast_to(column.numpy(), dr.width(inside)) for column in columns)
            where = ((row.astype(np.int64) * self._labels + label - 1) * self._bins.count + bin)[inside]
            z = ((real + 1j * imaginary) * root * np.exp(-1j * phase))[inside]
            # parts of one echo may come in several blocks, so sums are squared at the end
            real_sum += np.bincount(where, z.real, real_sum.size).reshape(shape)
            imaginary_sum += np.bincount(where, z.imag, real_sum.size).reshape(shape)
        power = self._source_power * (real_sum ** 2 + imaginary_sum ** 2)       # (rows, labels, bins) [µPa²]
        return CoherentSums(label_power=power, record=CoherentRecord(
            intensity=self._beams.shown(power.sum(1)), in_beam=np.asarray(power.any(1), np.uint32)))

    def _echoes(self, place: Place) -> Iterator[tuple[mi.UInt32, mi.UInt32, Echoes]]:
        """Yield the numbers of pings in the block, the labels and the echoes of all targets and smooth surfaces."""
        if self._targets:
            yield from target_echoes(self._sights, self._targets, place, len(place.ping), 0, mirrored=False)
        yield from self._smooth.echoes(place.sources, place.position, place.source_of)
