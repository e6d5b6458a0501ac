"""Directions that a sonar of any kind looks into at a ping, for plans that are drawn before anything is rendered.

Views are vertical half planes through the sonar. A sidescan has two of them, a fan one for each of some beams, an echo
sounder some all around. The level over depression angles is the two-way pattern of the faces of elements; of a
transmitting array it is the beam's.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.beam_patterns import beam_pattern
from mitsonar.units import db_from_power

from .energy.sidescan_survey import SidescanSurvey
from .pressure.array_survey import ArraySurvey
from .sensor import Sensor
from .soundings.survey import SwathSurvey
from .survey import Survey

if TYPE_CHECKING:                                        # of kinds of sonar that a scene may not have
    from .fan.kind import ArraySensor
    from .interferometric.plan import InterferometricSurvey
    from .multibeam.plan import MultibeamSensor

FANS = "array", "forward_looking"
FAN, AROUND = 61, 48               # views of a fan, and of a beam that looks down
SIDES = np.radians([-90.0, 90.0])  # port and starboard
UP, PAST, STEPS = np.radians(-80), np.radians(130), 841    # first and last depression angle, and number of them
STEEP = 0.7                        # sine of the depression from which a sonar looks down
FAINTEST_DB = -200.0


@dataclass(frozen=True, kw_only=True)
class Views:
    """Vertical half planes that a sonar looks into, in the body frame."""

    frequency: float  # [Hz]
    azimuth: np.ndarray  # (A,) [rad]: clockwise from forward
    depression: np.ndarray  # (K,) [rad]: ascending, and past the vertical, which a roll turns into view
    level_db: np.ndarray  # (A, K) [dB]: two-way pattern, relative to its greatest value
    round: bool = False  # True if the views are a beam that looks down, all around
    stabilised: bool = False  # True if depression angles are kept against the motion

    @property
    def fan(self) -> bool:
        """Return True if neighbouring views are neighbours in space, as those of a fan."""
        return len(self.azimuth) > 2


def views_of(survey: Survey, sensor: Sensor) -> Views:
    """Return the views of the sonar of a survey."""
    depression = np.linspace(UP, PAST, STEPS)
    if isinstance(survey, SwathSurvey):
        beams = np.concatenate([run.sector.beams for run in survey.sectors]) - survey.mounting[0]
        edges = np.array([[-beams.min()], [beams.max()]])
        return Views(frequency=survey.frequency, azimuth=SIDES, depression=depression,
                     level_db=np.where(np.pi / 2 - depression <= edges, 0.0, FAINTEST_DB),
                     stabilised=cast("MultibeamSensor", sensor).stabilised[0])
    if isinstance(survey, SidescanSurvey):
        across = survey.sonar.across_intensity(np.sin(depression - survey.sonar.depression_angle))
        return _relative(survey.sonar.frequency, SIDES, depression, np.stack([across, across]))
    if sensor.kind == "interferometric":
        sides = cast("InterferometricSurvey", survey).sides
        starboard = _patterns(sides[1], SIDES[1:], depression)
        return _relative(sides[1].frequency, SIDES, depression, np.repeat(starboard, 2, 0))
    from mitsonar.imaging.fan import fan_directions

    survey, width = cast(ArraySurvey, survey), cast("ArraySensor", sensor).fan_width if sensor.kind in FANS else 0.0
    return _of_array(survey, fan_directions(survey.receive, FAN if width else 1, width)[1], depression)


def _of_array(survey: ArraySurvey, looks: np.ndarray, depression: np.ndarray) -> Views:
    """Return the views of a sonar with arrays, whose beams have directions (B, 3)."""
    middle = looks[len(looks) // 2]
    if middle[2] < STEEP:
        azimuth = np.unwrap(np.arctan2(looks[:, 1], looks[:, 0]))
        return _relative(survey.frequency, azimuth, depression, _patterns(survey, azimuth, depression))
    if len(looks) == 1:
        azimuth = np.linspace(-np.pi, np.pi, AROUND + 1)
        return _relative(survey.frequency, azimuth, depression, _patterns(survey, azimuth, depression), round=True)
    # a fan that looks down: two views, out to its last beams
    azimuth = np.arctan2(*looks[[0, -1], 1::-1].T)
    power = _patterns(survey, azimuth, depression)
    lowest = np.arcsin(np.clip(looks[[0, -1], 2], -1, 1))[:, None]
    return _relative(survey.frequency, azimuth, depression, np.where(depression >= lowest, power, 0.0))


def _relative(frequency: float, azimuth: np.ndarray, depression: np.ndarray, power: np.ndarray,
              **fields: bool) -> Views:
    """Return views with a two-way power pattern (A, K)."""
    level = np.maximum(db_from_power(np.maximum(power / power.max(), 1e-20)), FAINTEST_DB)
    return Views(frequency=frequency, azimuth=azimuth, depression=depression, level_db=level, **fields)


def _patterns(survey: ArraySurvey, azimuth: np.ndarray, depression: np.ndarray) -> np.ndarray:
    """Return the two-way power pattern (A, K) of the transmitting beam and the receivers' faces."""
    level = np.cos(depression)
    direction = np.stack([np.cos(azimuth)[:, None] * level, np.sin(azimuth)[:, None] * level,
                          np.broadcast_to(np.sin(depression), (len(azimuth), len(depression)))], -1)
    alone = survey.sending is not None or survey.transmit.elements == 1
    sent = _face(survey.transmit, direction, survey.wavelength) if alone else beam_pattern(
        survey.transmit, direction, survey.wavelength, survey.planned_speed)
    return np.abs(sent * _face(survey.receive, direction, survey.wavelength)) ** 2


def _face(array: Array, direction: np.ndarray, wavelength: float) -> np.ndarray:
    """Return the pressure pattern of an array's first element."""
    return np.asarray(array.element_pressure(direction, wavelength, array.normal[0], array.along[0]))
