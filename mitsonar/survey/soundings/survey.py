"""Define the surveys of runs that make soundings; a multibeam has a run of arrays for every sector."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.sonar.arrays.sectors import Sector

from ..pressure.array_survey import ArraySurvey
from ..sensor import RunSettings, Sensor
from ..survey import Survey
from ..voyage import Passage


class SoundingSensor(Sensor, Protocol):
    """Define the sensor of an instrument that makes soundings.

    Attributes
    ----------
    preset : str
    head_speed_error, motion_errors, depth_gate
        As of `SoundedSurvey`.
    self_noise_db : float or None [dB re 1 µPa²/Hz]
        Of each receiver.
    """

    preset: str
    head_speed_error: float
    motion_errors: MotionErrors
    depth_gate: tuple[float, float] | None
    self_noise_db: float | None


def shared(run: ArraySurvey, passage: Passage, sensor: SoundingSensor, settings: RunSettings) -> dict:
    """Return the arguments of any `SoundedSurvey` of which `run` is a part."""
    return dict(
        geometry=run.geometry, profile=run.profile, absorption=run.absorption, volume=run.volume, passage=passage,
        rays=settings.rays, max_depth=settings.max_depth, head_speed_error=sensor.head_speed_error,
        motion_errors=sensor.motion_errors, depth_gate=sensor.depth_gate, preset=sensor.preset)


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmission:
    """Hold one of a ping's transmissions, as its soundings need it."""

    survey: ArraySurvey  # its track is at the times of the transmission
    delay: float  # [s]: after the ping's first
    sines: np.ndarray  # (P,) [-]: along the transmitting line, as the instrument takes them to be
    beams: slice  # of all beams, those that listen to it


@dataclass(frozen=True, kw_only=True, eq=False)
class SoundedSurvey(Survey, ABC):
    """Hold a run that makes soundings; abstract."""

    head_speed_error: float  # [m/s]
    motion_errors: MotionErrors
    depth_gate: tuple[float, float] | None  # [m]: below the sonar
    preset: str

    @property
    @abstractmethod
    def transmissions(self) -> Sequence[Transmission]:
        """Return the transmissions of a ping, in the order of their beams."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorRun:
    """Hold a sector's transmissions of all pings."""

    sector: Sector
    survey: ArraySurvey  # of its transmissions
    sines: np.ndarray  # (P, B) [-]: of the beams on the receiving line, as they are
    said: np.ndarray  # (P,) [-]: times these, what the instrument takes the sines to be
    transmit_sines: np.ndarray  # (P,) [-]: of the transmissions along the transmitting line, as they are
    first: int  # number of its first beam among all

    @property
    def beams(self) -> slice:
        """Return the slice of all beams that are this sector's."""
        return slice(self.first, self.first + self.sines.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathSurvey(SoundedSurvey):
    """Hold a run of a multibeam echo sounder."""

    sectors: Sequence[SectorRun]  # in the order of their beams
    mounting: np.ndarray  # (3,) [rad]: roll, pitch, heading of the head
    receive_flaws: float  # root mean square of what each receiver is off, in amplitude and in phase [rad]

    @property
    def beams(self) -> int:
        """Return the number of beams of all sectors."""
        return sum(run.sines.shape[1] for run in self.sectors)

    @property
    def frequency(self) -> float:
        """Return the frequency of the first sector [Hz]."""
        return self.sectors[0].survey.frequency

    @property
    def transmissions(self) -> Sequence[Transmission]:
        """Return the transmissions of a ping, in the order of their beams."""
        return [Transmission(survey=run.survey, delay=run.sector.delay, sines=run.transmit_sines * run.said,
                             beams=run.beams) for run in self.sectors]
