"""What a run that makes soundings is; of a multibeam: a run of arrays for every sector, and where its beams look."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.sonar.arrays.sectors import Sector

from ..pressure.array_survey import ArraySurvey
from ..survey import Survey

__all__ = ["SectorRun", "SoundedSurvey", "SwathSurvey", "Transmission"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmission:
    """One of a ping's transmissions, as its soundings need it.

    Attributes
    ----------
    survey : ArraySurvey
        Its track is at the times of the transmission.
    delay : float [s]
        After the ping's first.
    sines : (P,) [-]
        Along the transmitting line, as the instrument takes them to be.
    beams : slice
        Of all beams, those that listen to it.
    """

    survey: ArraySurvey
    delay: float
    sines: np.ndarray
    beams: slice


@dataclass(frozen=True, kw_only=True, eq=False)
class SoundedSurvey(Survey, ABC):
    """A run that makes soundings; abstract.

    Attributes
    ----------
    head_speed_error : float [m/s]
    motion_errors : MotionErrors
    depth_gate : (float, float) or None [m]
        Below the sonar.
    preset : str
    """

    head_speed_error: float
    motion_errors: MotionErrors
    depth_gate: tuple[float, float] | None
    preset: str

    @property
    @abstractmethod
    def transmissions(self) -> Sequence[Transmission]:
        """Of a ping, in the order of their beams."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorRun:
    """A sector's transmissions of all pings.

    Attributes
    ----------
    sector : Sector
    survey : ArraySurvey
        Of its transmissions: its track is at their times, its `steering` what they are steered by.
    sines : (P, B) [-]
        Of the beams on the receiving line, as they are; rising with the beam.
    said : (P,) [-]
        Times these, what the instrument takes the sines to be: c_head / c, by the head's own sound speed.
    transmit_sines : (P,) [-]
        Of the transmissions along the transmitting line, as they are.
    first : int
        Number of its first beam among all.
    """

    sector: Sector
    survey: ArraySurvey
    sines: np.ndarray
    said: np.ndarray
    transmit_sines: np.ndarray
    first: int

    @property
    def beams(self) -> slice:
        """Of all beams, those of this sector."""
        return slice(self.first, self.first + self.sines.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathSurvey(SoundedSurvey):
    """A run of a multibeam echo sounder.

    Attributes
    ----------
    sectors : sequence of SectorRun
        In the order of their beams.
    mounting : (3,) [rad]
        Roll, pitch, heading of the head.
    receive_flaws : float
        Root mean square of what each receiver is off, in amplitude and in phase [rad].
    """

    sectors: Sequence[SectorRun]
    mounting: np.ndarray
    receive_flaws: float

    @property
    def beams(self) -> int:
        """How many, of all sectors."""
        return sum(run.sines.shape[1] for run in self.sectors)

    @property
    def frequency(self) -> float:
        """Of the first sector [Hz]."""
        return self.sectors[0].survey.frequency

    @property
    def transmissions(self) -> Sequence[Transmission]:
        """Of a ping, in the order of their beams."""
        return [Transmission(survey=run.survey, delay=run.sector.delay, sines=run.transmit_sines * run.said,
                             beams=run.beams) for run in self.sectors]
