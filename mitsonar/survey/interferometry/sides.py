"""The signals of a side's rows in the beam domain, and the truth of its bins from the same echoes.

Rows are apertures of one element each of the line that they make: a beam of one element, steered nowhere, is what the
element hears. Waves are plane over the rows; the pulse comes to them one after the other.
"""
from __future__ import annotations

import mitsuba as mi
import numpy as np

from ...device.chance import ping_key, sonar_seed
from ...imaging.energy_record import EnergyRecord
from ...signal.beam_grid import LineBeams, NoiseDensity
from ...sonar.array import Array
from ...units import amplitude_from_db, power_from_db
from ..beam_domain.blur import OneBeam
from ..beam_domain.laying import LaidPing, lay
from ..beam_domain.line import LineArray
from ..beam_domain.ping_echoes import PingEchoes
from ..beam_domain.truth import FrameTruth
from .plan import up_along
from .survey import SIDES, InterferometricSurvey

__all__ = ["SideRows", "both_sides"]

WIDEST = 1.05                      # sine: rows that move see echoes from beyond 1


def both_sides(survey: InterferometricSurvey) -> tuple[SideRows, SideRows]:
    """Make what hears for either side; they share what they know of the scene."""
    port = SideRows(survey, 0)
    return port, SideRows(survey, 1, beside=port)


class SideRows:
    """Make the signals of one side.

    Parameters
    ----------
    survey : InterferometricSurvey
    number : int
        0 is port.
    beside : SideRows or None
        The other side.
    """

    def __init__(self, survey: InterferometricSurvey, number: int, beside: SideRows | None = None):
        self._whole, self._number = survey, number
        self.survey = side = survey.sides[number]
        self.line = line = _line(side.receive, side.wavelength)
        longest = max(side.transmit.length, side.receive.length)
        self._echoes = PingEchoes(side, line, per_cell=side.per_cell, beams_from_origin=False,
                                  beside=None if beside is None else beside._echoes,
                                  lobe=(side.receive.along[0], side.wavelength / longest))
        self._beams = LineBeams(
            mi.Float, position=line.place, weight=np.eye(len(line.place)), pulse=side.pulse, samples=side.samples,
            sampling_rate=side.sampling_rate, lead=side.lead, start=side.start, sines=np.zeros(1),
            sound_speed=side.sound_speed(0), absorption_db=side.absorption_db)
        self._noise = NoiseDensity.of(side.noise, side.source_level_db)
        per_bin = survey.per_bin
        self._truth = FrameTruth(OneBeam(WIDEST, side.pulse.bandwidth * per_bin / side.sampling_rate),
                                 lead=side.lead, bins=survey.bins, named=side.geometry.named, per_bin=per_bin,
                                 of_objects=True)

    def signals(self, ping: int, seed: int) -> np.ndarray:
        """Give the compressed signals (rows, samples) [µPa] of a ping, complex64."""
        return self._heard(ping, seed)[0]

    def frame(self, ping: int, seed: int) -> tuple[np.ndarray, EnergyRecord]:
        """Give the same, and the truth of the bins, arrays (1, ..., bins)."""
        signals, laid = self._heard(ping, seed)
        side = self.survey
        truth = self._truth.of(
            laid.scatterers, self._echoes.hiding(ping, laid.scatterers), laid.targets,
            origin=side.track.position[ping], depth_below=float(side.depth_below[ping]),
            farthest=0.5 * side.time[-1] * side.sound_speed(ping),
            source_power=float(power_from_db(side.source_level_db)))
        return signals, truth

    def _heard(self, ping: int, seed: int) -> tuple[np.ndarray, LaidPing]:
        own = seed if not self._number else sonar_seed(seed, SIDES[self._number])
        grid = self._beams.grid()
        laid = lay(self._echoes, grid, ping, own)
        rows = self._beams.form_each(grid, doppler=self._echoes.doppler(ping), noise=self._noise,
                                     key=ping_key(own, ping))[:, 0]
        return rows * np.float32(amplitude_from_db(self.survey.source_level_db)), laid


def _line(receive: Array, wavelength: float) -> LineArray:
    """The rows as a line along the face's upward axis."""
    sines = np.array([-0.5, 0.0, 0.5])
    fan = sines[:, None] * up_along(receive) + np.sqrt(1 - sines ** 2)[:, None] * receive.normal[0]
    return LineArray.of(receive, fan, wavelength)
