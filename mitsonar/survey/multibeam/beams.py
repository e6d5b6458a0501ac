"""The beams of a sector's pings in the beam domain: those of either half of the receiving line, and their truth."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mitsonar.device.chance import Salt, ping_key, sonar_seed
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.signal.beam_grid import NoiseDensity
from mitsonar.sonar.arrays.sectors import half_power_width
from mitsonar.units import amplitude_from_db

from ..beam_domain.blur import Blur
from ..beam_domain.frames import LaidPing, lay, line_beams
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from ..soundings.survey import SectorRun, SwathSurvey

MAIN_LOBE = 0.25                   # of its axis: half the amplitude
FINER = 8                          # steps of a side lobe


@dataclass(frozen=True, kw_only=True, eq=False)
class Halves:
    """Hold beams of a ping, compressed."""

    port: np.ndarray  # (B, T) [µPa]: of either half of the receiving line
    starboard: np.ndarray  # (B, T) [µPa]: of either half of the receiving line

    @property
    def whole(self) -> np.ndarray:
        """Return beams of the whole line."""
        return 0.5 * (self.port + self.starboard)


def sector_beams(survey: SwathSurvey) -> list[SectorBeams]:
    """Make the beams of each sector."""
    made: list[SectorBeams] = []
    for number, run in enumerate(survey.sectors):
        made.append(SectorBeams(run, number, survey.receive_flaws, beside=made[0] if made else None))
    return made


class SectorBeams:
    """Form the beams of one sector, ping by ping."""

    def __init__(self, run: SectorRun, number: int, flaws: float = 0.0, beside: SectorBeams | None = None):
        self.run, self._number = run, number
        survey = run.survey
        self.line = line = LineArray.along(survey.receive, survey.receive.along[0], survey.wavelength)
        self._echoes = PingEchoes(survey, line, per_cell=survey.per_cell, beams_from_origin=False,
                                  beside=None if beside is None else beside._echoes)
        port = line.place < 0
        halves = np.stack([np.where(port, line.weight, 0.0), np.where(port, 0.0, line.weight)])
        flawed = _flawed(halves, flaws)
        # beams are relative to the sum of their weights' sizes, and are to be right on their axes
        self._gain = np.abs(flawed).sum(1) / np.abs(halves).sum(1)
        #: between the phase centres of the halves [wavelengths]
        self.baseline = float(np.diff((halves @ line.place) / halves.sum(1))[0]) / survey.wavelength
        #: of beams at right angles to the line, at -3 dB [sine]
        self.lobe_width = half_power_width(line.place, line.weight) * survey.wavelength
        self._lobes = _side_lobes(line.place / survey.wavelength, flawed.sum(0))
        self._beams = line_beams(survey, line.place, flawed, np.array([run.sines.min(), run.sines.max()]))
        self._noise = NoiseDensity.of(survey.noise, survey.source_level_db)
        self._truth: tuple[np.ndarray, FrameTruth] | None = None

    def beam_width(self, sines: np.ndarray) -> np.ndarray:
        """Return widths of beams at sines (B,), at -3 dB [rad]."""
        return self.lobe_width / np.sqrt(np.maximum(1 - sines ** 2, 1e-3))

    def side_lobes(self, sines: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return power pattern (B, J) of beams at sines (B,) towards others (J,), 0 within their main lobes."""
        gap, level = self._lobes
        return np.interp(np.abs(sines[:, None] - others), gap, level)

    @property
    def transmit_width(self) -> float:
        """Return the transmission's width along the track at -3 dB, steered straight down [rad]."""
        transmit = self.run.survey.transmit
        return half_power_width(transmit.position @ transmit.along[0], transmit.weight) * self.run.survey.wavelength

    @property
    def time(self) -> np.ndarray:
        """Return the times of the samples after the transmission [s], (T,)."""
        return self.run.survey.time[self.run.survey.lead:]

    def halves(self, ping: int, seed: int) -> Halves:
        """Form the beams of a ping."""
        return self._formed(ping, seed)[0]

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Form the beams (B, T) [µPa] of the whole line, and their truth."""
        halves, laid = self._formed(ping, seed)
        return halves.whole, laid.truth(self._echoes, ping, self._truth_of(ping))

    def _formed(self, ping: int, seed: int) -> tuple[Halves, LaidPing]:
        own = seed if not self._number else sonar_seed(seed, f"sector {self._number}")
        grid = self._beams.grid()
        laid = lay(self._echoes, grid, ping, own)
        beams = self._beams.form_each(grid, doppler=self._echoes.doppler(ping), noise=self._noise,
                                      key=ping_key(own, ping), sines=self.run.sines[ping])
        beams *= (amplitude_from_db(self.run.survey.source_level_db) * self._gain)[:, None, None].astype(np.float32)
        return Halves(port=beams[0], starboard=beams[1]), laid

    def _truth_of(self, ping: int) -> FrameTruth:
        """Return the truth's beams of a ping; the last ones are kept."""
        sines = self.run.sines[ping]
        if self._truth is None or not np.array_equal(self._truth[0], sines):
            survey, line = self.run.survey, self.line
            blur = Blur(sines, line.place / survey.wavelength, line.weight,
                        survey.pulse.bandwidth / survey.sampling_rate)
            self._truth = sines, FrameTruth(blur, lead=survey.lead, bins=survey.samples - survey.lead,
                                            named=survey.geometry.named)
        return self._truth[1]


def _flawed(halves: np.ndarray, flaws: float) -> np.ndarray:
    """Return weights (2, E) of elements that are off; each half is calibrated, so that it is right on its axis."""
    if not flaws:
        return halves
    draw = np.random.default_rng([halves.shape[1], Salt.RECEIVER_FLAWS]).standard_normal((2, halves.shape[1]))
    off = halves * (1 + flaws * draw[0]) * np.exp(1j * flaws * draw[1])
    size = np.abs(halves).sum(1, keepdims=True)
    return off * (size / off.sum(1, keepdims=True))


def _side_lobes(place: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return power pattern of a line (N,) [wavelengths] against the gap of sines, peaks of its side lobes joined.

    It is 0 where it is above `MAIN_LOBE`, that of beams that hear the same bed, and nowhere more than that: two beams
    that are each other's grating lobe are not told apart.
    """
    step = 1 / (FINER * np.ptp(place))
    gap = np.arange(0.0, 2.0 + step, step)
    level = np.concatenate([np.abs(np.exp(2j * np.pi * np.multiply.outer(some, place)) @ weight) ** 2
                            for some in np.array_split(gap, -(-len(gap) // 1024))])
    level = level / np.abs(weight).sum() ** 2
    main = np.flatnonzero(level < MAIN_LOBE)[0]
    joined = ndimage.maximum_filter1d(level, FINER + 1, mode="nearest")
    return gap, np.where(np.arange(len(gap)) < main, 0.0, np.minimum(joined, MAIN_LOBE))
