"""Surveys of sonars that make soundings; a multibeam has one array survey for every sector."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from mitsonar.hydrography.detection.written_strength import StrengthWriting
from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.imaging.recorder import Recorder
from mitsonar.io.grids.separation import Separation
from mitsonar.sonar.arrays.sectors import Sector
from mitsonar.sonar.motion.stepping import SteppedPing, Stepping
from mitsonar.sonar.motion.trajectory import Voyage

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
        preset=sensor.preset, separation=sensor.water.separation, vertical_datum=sensor.water.vertical_datum)


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
    separation: Separation | None = None  # of the datum z = 0 from the ellipsoid; None: unknown
    vertical_datum: str = ""  # its name

    @property
    @abstractmethod
    def transmissions(self) -> Sequence[Transmission]:
        """Return the transmissions of a ping, in order of their beams."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Aim:
    """Directions of a sector's beams and transmissions at pings."""

    sines: np.ndarray  # (P, B) [-], true sines of the beams along the receiving line
    said: np.ndarray  # (P,) [-], ratio of the sines that the instrument assumes to the true sines
    transmit_sines: np.ndarray  # (P,) [-], true sines of the transmissions along the transmitting line


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorAim:
    """Aim of a sector at the pings of a survey; its items are the steering of the transmitting line."""

    survey: ArraySurvey  # of the transmissions, without steering
    find: Callable[[Voyage, np.ndarray, np.ndarray], Aim]  # of a voyage, depths below (P,) [m], sound speeds (P,) [m/s]
    along: np.ndarray  # (3,) [-], of the transmitting line

    @cached_property
    def planned(self) -> Aim:
        """Return the aim at the planned pings."""
        return self.find(self.survey.planned, self.survey.passage.depth_below, self.survey.sound_speeds)

    @property
    def now(self) -> Aim:
        """Return the aim at the planned pings, or at the latest stepped one."""
        survey, latest = self.survey, self.survey.passage.latest
        if latest is None:
            return self.planned
        if latest not in self._found:
            self._found.clear()
            speed = np.array([survey.sound_speed(latest.ping)])
            aim = self.find(survey.voyage.single, survey.depth_below[-1:], speed)
            self._found[latest] = Aim(**{name: np.broadcast_to(values[0], (latest.ping + 1, *values.shape[1:]))
                                         for name, values in vars(aim).items()})
        return self._found[latest]

    @cached_property
    def _found(self) -> dict[SteppedPing, Aim]:
        """Return the aim at the latest stepped ping, by this ping."""
        return {}

    def __getitem__(self, ping: int) -> np.ndarray:
        return self.now.transmit_sines[ping] * self.along


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorRun:
    """Transmissions of one sector at all pings."""

    sector: Sector
    survey: ArraySurvey  # of the transmissions of this sector
    aim: SectorAim
    first: int  # number of the first beam of this sector among all beams

    @property
    def sines(self) -> np.ndarray:
        """Return the true sines of the beams along the receiving line (P, B) [-]."""
        return self.aim.now.sines

    @property
    def said(self) -> np.ndarray:
        """Return the ratio of the sines that the instrument assumes to the true sines (P,) [-]."""
        return self.aim.now.said

    @property
    def transmit_sines(self) -> np.ndarray:
        """Return the true sines of the transmissions along the transmitting line (P,) [-]."""
        return self.aim.now.transmit_sines

    @property
    def beams(self) -> slice:
        """Return the beams of this sector among all beams."""
        return slice(self.first, self.first + len(self.sector.beams))

    def stepped(self, stepping: Stepping) -> SectorRun:
        """Return the run of a sonar that is stepped."""
        aim = replace(self.aim, survey=self.aim.survey.stepped(stepping))
        return replace(self, survey=replace(self.survey.stepped(stepping), steering=aim), aim=aim)


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathSurvey(SoundedSurvey):
    """Survey of a multibeam echo sounder."""

    sectors: Sequence[SectorRun]  # in order of their beams
    mounting: np.ndarray  # (3,) [rad], roll, pitch and heading of the head
    receive_flaws: float  # root mean square error of receivers, in amplitude [-] and in phase [rad]
    strength_writing: StrengthWriting | None  # None: strengths are written as they are
    column_recorder: Recorder | None  # of the water column of soundings; None: levels are kept as they are

    def _made_within(self, ping: int) -> SwathSurvey:
        """Return a new survey in which all pings, of all sectors, have the surroundings of one."""
        return replace(super()._made_within(ping),
                       sectors=[replace(run, survey=run.survey.within(ping)) for run in self.sectors])

    def stepped(self, stepping: Stepping) -> SwathSurvey:
        """Return the survey of a sonar that is stepped, with this one as its plan."""
        return replace(super().stepped(stepping), sectors=[run.stepped(stepping) for run in self.sectors])

    @property
    def beams(self) -> int:
        """Return the number of beams of all sectors."""
        return sum(len(run.sector.beams) for run in self.sectors)

    @property
    def frequency(self) -> float:
        """Return the frequency of the first sector [Hz]."""
        return self.sectors[0].survey.frequency

    @property
    def transmissions(self) -> Sequence[Transmission]:
        """Return the transmissions of a ping, in order of their beams."""
        return [Transmission(survey=run.survey, delay=run.sector.delay, sines=run.transmit_sines * run.said,
                             beams=run.beams) for run in self.sectors]
