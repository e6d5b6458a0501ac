"""Beams of a sector's pings in the beam domain, formed of either half of the receiving line, and their truth."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from mitsonar.device.chance import sonar_seed
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.sonar.arrays.array_factor import array_factor
from mitsonar.sonar.arrays.channels import flawed
from mitsonar.sonar.arrays.sectors import half_power_width
from mitsonar.units import amplitude_from_db

from ..beam_domain.blur import Blur
from ..beam_domain.frames import LaidPing, LineFrames
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from ..soundings.survey import SectorRun, SwathSurvey

MAIN_LOBE = 0.25                   # power relative to the axis at which the main lobe ends: half the amplitude
FINER = 8                          # steps within a side lobe


@dataclass(frozen=True, kw_only=True, eq=False)
class Halves:
    """Compressed beams (B, T) [µPa] of a ping, of both halves of the receiving line."""

    port: np.ndarray
    starboard: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """Return the beams of the whole line."""
        return 0.5 * (self.port + self.starboard)


def sector_beams(survey: SwathSurvey) -> list[SectorBeams]:
    """Return the beamformers of all sectors; they share their tables of the scene."""
    sectors: list[SectorBeams] = []
    for number, run in enumerate(survey.sectors):
        sectors.append(SectorBeams(run, number, survey.receive_flaws, beside=sectors[0] if sectors else None))
    return sectors


class SectorBeams(LineFrames):
    """Beams of one sector, ping by ping."""

    def __init__(self, run: SectorRun, number: int, flaws: float = 0.0, beside: SectorBeams | None = None):
        self.run, self._number, survey = run, number, run.survey
        line = LineArray.along(survey.receive, survey.receive.along[0], survey.wavelength)
        port = line.place < 0
        halves = np.stack([np.where(port, line.weight, 0.0), np.where(port, 0.0, line.weight)])
        # each half is calibrated
        received = flawed(halves, flaws)
        # beams are relative to the sum of the magnitudes of their weights, and must be right on their axes
        gain = np.abs(received).sum(1) / np.abs(halves).sum(1)
        super().__init__(survey, PingEchoes(survey, line, per_cell=survey.per_cell, beams_from_origin=False,
                                            beside=None if beside is None else beside.echoes),
                         received, np.array([run.aim.planned.sines.min(), run.aim.planned.sines.max()]),
                         amplitude_from_db(survey.source_level_db) * gain)
        #: distance of the phase centres of the halves [wavelengths]
        self.baseline = float(np.diff((halves @ line.place) / halves.sum(1))[0]) / survey.wavelength
        #: width at -3 dB of beams at right angles to the line [sine]
        self.lobe_width = half_power_width(line.place, line.weight) * survey.wavelength
        self._lobes = _side_lobes(line.place / survey.wavelength, received.sum(0))
        self._truth: tuple[np.ndarray, FrameTruth] | None = None

    def beam_width(self, sines: np.ndarray) -> np.ndarray:
        """Return the widths at -3 dB [rad] of beams at sines (B,)."""
        return self.lobe_width / np.sqrt(np.maximum(1 - sines ** 2, 1e-3))

    def side_lobes(self, sines: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return the power pattern (B, J) of beams at sines (B,) towards others (J,), 0 within their main lobes."""
        gap, level = self._lobes
        return np.interp(np.abs(sines[:, None] - others), gap, level)

    @property
    def transmit_width(self) -> float:
        """Return the transmission's width along the track at -3 dB, steered straight down [rad]."""
        transmit = self.survey.transmit
        return half_power_width(transmit.position @ transmit.along[0], transmit.weight) * self.survey.wavelength

    @property
    def time(self) -> np.ndarray:
        """Return the times of the samples after the transmission [s], (T,)."""
        return self.survey.time[self.survey.lead:]

    def halves(self, ping: int, seed: int) -> Halves:
        """Return the beams of a ping."""
        return self._halves(ping, seed)[0]

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Return the beams (B, T) [µPa] of the whole line, and their truth."""
        halves, laid = self._halves(ping, seed)
        return halves.whole, self.truth(ping, laid, self._truth_of(ping))

    def _halves(self, ping: int, seed: int) -> tuple[Halves, LaidPing]:
        own = sonar_seed(seed, f"sector {self._number}") if self._number else seed
        beams, laid = self.formed(ping, own, self.run.sines[ping])
        return Halves(port=beams[0], starboard=beams[1]), laid

    def _truth_of(self, ping: int) -> FrameTruth:
        """Return the truth's beams of a ping; the latest are kept."""
        sines, survey = self.run.sines[ping], self.survey
        if self._truth is None or not np.array_equal(self._truth[0], sines):
            blur = Blur(sines, self.line.place / survey.wavelength, self.line.weight,
                        survey.pulse.bandwidth / survey.sampling_rate)
            self._truth = sines, FrameTruth(blur, lead=survey.lead, bins=survey.samples - survey.lead,
                                            named=survey.world.named)
        return self._truth[1]


def _side_lobes(place: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gaps of sines, and the envelope of a line's side lobes, in power, against them; place in wavelengths.

    The envelope is 0 in the main lobe (above `MAIN_LOBE`), where two beams receive the same bed, and `MAIN_LOBE` at
    most elsewhere: two beams that are each other's grating lobe cannot be separated.
    """
    step = 1 / (FINER * np.ptp(place))
    gap = np.arange(0.0, 2.0 + step, step)
    level = np.abs(array_factor(place, weight / np.abs(weight).sum(), first=0, step=step, count=len(gap))) ** 2
    main = np.flatnonzero(level < MAIN_LOBE)[0]
    joined = scipy.ndimage.maximum_filter1d(level, FINER + 1, mode="nearest")
    return gap, np.where(np.arange(len(gap)) < main, 0.0, np.minimum(joined, MAIN_LOBE))
