"""Coherent echoes of targets and smooth surfaces, as the beams of an array or of a rotating head receive them.

Pressures of an instance in a bin add, and are then squared. The pulse and the beams' side lobes blur these squares like
all energies (`array_beams`); the picture itself takes its pressures from the elements' signals.
"""
from __future__ import annotations

from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.types import Vector
from mitsonar.imaging.energy_record import CoherentRecord, CoherentSums, powers

from ..motion.places import Place
from ..pressure.array_survey import ArraySurvey
from .energy_bins import EnergyBins
from .phased_echoes import PhasedEchoes, band_of
from .sound_paths import SoundPaths

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
        self._beams, self._bins, self._labels = beams, bins, len(survey.labels)
        self._phased = PhasedEchoes(
            sound, frequency=survey.frequency, band=band_of(survey.pulse), drift=drift, mirrored=False,
            resolution=FLAT_BAND * survey.planned_speed / survey.sampling_rate, farthest=sound.tracer.max_range)
        self._source_power = 10 ** (survey.source_level_db / 10)

    @property
    def silent(self) -> bool:
        """Return True if the scene has no coherent echoes."""
        return not self._phased

    def sum(self, place: Place) -> CoherentSums:
        """Sum the echoes of a block of pings; arrays (pings x beams, ..., bins)."""
        shape, parts = (len(place.ping) * self._beams.count, self._labels, self._bins.count), []
        for arrivals in self._phased.of(place, 0, len(place.ping)):
            row, pattern = self._beams.receive(place, arrivals.ping, arrivals.echoes.out.sent_towards,
                                               arrivals.towards)
            bin, inside = self._bins.of(arrivals.delay, pattern > 0)
            root = dr.sqrt(pattern)
            columns = (arrivals.ping * self._beams.count + row, arrivals.label, bin, inside, arrivals.real * root,
                       arrivals.imaginary * root)
            dr.eval(columns)
            row, label, bin, inside, real, imaginary = (
                np.broadcast_to(column.numpy(), dr.width(inside)) for column in columns)
            cell = (row.astype(np.int64) * self._labels + label - 1) * self._bins.count + bin
            parts.append((cell[inside], real[inside], imaginary[inside]))
        power = np.zeros(shape)                                                 # (rows, labels, bins) [µPa²]
        if parts:              # parts of one echo may come in several blocks
            cell, squares = powers(*(np.concatenate(column) for column in zip(*parts)))
            power.ravel()[cell] = self._source_power * squares
        return CoherentSums(label_power=power, record=CoherentRecord(
            intensity=self._beams.shown(power.sum(1)), in_beam=np.asarray(power.any(1), np.uint32)))
