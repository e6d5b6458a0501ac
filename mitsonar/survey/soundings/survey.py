"""Surveys of sonars that make soundings; a multibeam has one array survey for every sector."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.sonar.arrays.sectors import Sector

from ..pressure.array_survey import ArraySurvey
from ..sensor import RunSettings, Sensor
from ..survey import Survey
from ..voyage import Passage


class SoundingSensor(Sensor, Protocol):
    """Sensor that makes soundings; fields without a comment are those of `SoundedSurvey`."""

    preset: str
    head_speed_error: float
    motion_errors: MotionErrors
    depth_gate: tuple[float, float] | None
    self_noise_db: float | None  # [dB re 1 µPa²/Hz], of each receiver


def shared(run: ArraySurvey, passage: Passage, sensor: SoundingSensor, settings: RunSettings) -> dict:
    """Return the arguments that every kind of `SoundedSurvey` has in common; `run` is one of its array surveys."""
    return dict(
        world=run.world, waters=run.waters, passage=passage, rays=settings.rays, max_depth=settings.max_depth,
        head_speed_error=sensor.head_speed_error, motion_errors=sensor.motion_errors, depth_gate=sensor.depth_gate,
        preset=sensor.preset)


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmission:
    """One transmission of all pings, as soundings need it."""

    survey: ArraySurvey  # its track has the times of this transmission
    delay: float  # [s], after the first transmission of the ping
    sines: np.ndarray  # (P,) [-], along the transmitting line, as the instrument assumes them
    beams: slice  # beams that receive this transmission, among all beams


@dataclass(frozen=True, kw_only=True, eq=False)
class SoundedSurvey(Survey, ABC):
    """Survey of a sonar that makes soundings; abstract."""

    head_speed_error: float  # [m/s], measured minus true sound speed at the head
    motion_errors: MotionErrors
    depth_gate: tuple[float, float] | None  # [m], below the sonar
    preset: str

    @property
    @abstractmethod
    def transmissions(self) -> Sequence[Transmission]:
        """Return the transmissions of a ping, in order of their beams."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorRun:
    """Transmissions of one sector at all pings."""

    sector: Sector
    survey: ArraySurvey  # of the transmissions of this sector
    sines: np.ndarray  # (P, B) [-], true sines of the beams along the receiving line
    said: np.ndarray  # (P,) [-], ratio of the sines that the instrument assumes to the true sines
    transmit_sines: np.ndarray  # (P,) [-], true sines of the transmissions along the transmitting line
    first: int  # number of the first beam of this sector among all beams

    @property
    def beams(self) -> slice:
        """Return the beams of this sector among all beams."""
        return slice(self.first, self.first + self.sines.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathSurvey(SoundedSurvey):
    """Survey of a multibeam echo sounder."""

    sectors: Sequence[SectorRun]  # in order of their beams
    mounting: np.ndarray  # (3,) [rad], roll, pitch and heading of the head
    receive_flaws: float  # root mean square error of receivers, in amplitude [-] and in phase [rad]

    def _made_within(self, ping: int) -> SwathSurvey:
        """Return a new survey in which all pings, of all sectors, have the surroundings of one."""
        return replace(super()._made_within(ping),
                       sectors=[replace(run, survey=run.survey.within(ping)) for run in self.sectors])

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
        """Return the transmissions of a ping, in order of their beams."""
        return [Transmission(survey=run.survey, delay=run.sector.delay, sines=run.transmit_sines * run.said,
                             beams=run.beams) for run in self.sectors]
