"""Run of a sonar that is stepped: what is planned once, and the pings at poses that are given as they come."""
from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, cast

import mitsuba as mi
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.sonar.motion.stepping import Steady, SteppedPing, Stepping, planned_row
from mitsonar.sonar.motion.track import FIELDS, Track
from mitsonar.sonar.motion.trajectory import Trajectory
from mitsonar.water.profile import SoundSpeedProfile

from . import placement
from .integrator import SoundIntegrator
from .kinds import sounder_kind_of
from .pressure.pressure import PressureRecord
from .pressure.signals import LEAD
from .sensor import Sensor, slowest_speed
from .soundings.heights import DepthReference
from .soundings.line import Instrument, SoundingLine
from .soundings.survey import SoundedSurvey
from .survey import Survey

FASTER = 1e-6                      # share by which a ping may be faster than planned, for rounding
POSE = "position", "attitude", "velocity", "turn_rate"
Moves = dict[str, tuple[dict[str, np.ndarray], float | None]]      # poses of objects, and times [s] unless the ping's
FASTEST, FASTEST_TURN = 50.0, 2 * np.pi    # [m/s], [rad/s]: of objects


class SteppedRun:
    """Run of a sonar over a scene, planned along the scene's route and then stepped."""

    def __init__(self, scene: mi.Scene, sensor: Sensor, integrator: SoundIntegrator, seed: int):
        self._scene, self._sensor, self._integrator, self._seed = scene, sensor, integrator, seed
        self._stepping = Stepping()
        self.survey: Survey = integrator.survey(scene, sensor, seed).stepped(self._stepping)
        self.frame: Callable[[int], xr.Dataset] = integrator.frame(self.survey, sensor, seed)
        self._moves: Moves = {}                            # since the latest ping
        self._before = self._stepping.moved, self._moves   # what a ping that fails goes back to
        self._shortest = sensor.film().window(slowest_speed(sensor))[0][1]

    @property
    def latest(self) -> SteppedPing | None:
        """Return the latest ping; None before the first one."""
        return self._stepping.latest

    def go(self, ping: SteppedPing | None) -> None:
        """Go to a ping: to the next one with the objects where they were moved to, or back to the one before."""
        stepping, number = self._stepping, -1 if self.latest is None else self.latest.ping
        if ping is not None and ping.ping > number:
            self._before = stepping.moved, self._moves
            stepping.moved = stepping.moved | {
                name: Trajectory(lead=Steady(time=ping.time if time is None else time, **pose))
                for name, (pose, time) in self._moves.items()}
            self._moves = {}
        elif ping is not stepping.latest:
            stepping.moved, self._moves = self._before
        stepping.latest = ping

    @property
    def next_time(self) -> float:
        """Return the time of the next ping [s], unless another is given."""
        passage = self.survey.passage
        return float(passage.voyage.track.time[0]) if self.latest is None else self.latest.time + passage.interval

    @property
    def stated(self) -> dict[str, object]:
        """Return what a record states about the water of the latest ping, if it is not that of a planned one."""
        return {} if self.latest is None else {**self.survey.waters.of_step(self.latest).stated}

    def sounded(self, profile: SoundSpeedProfile | None, by: DepthReference | None = None, *, column: bool,
                snippets: int) -> xr.Dataset:
        """Return the soundings of the latest ping; arguments as of `mitsonar.soundings`."""
        assert self.latest is not None
        if (column, snippets) not in self._instruments:
            self._instruments[column, snippets] = sounder_kind_of(self._sensor).instrument(
                self.survey, self._sensor.own_seed(self._seed), column=column, snippets=snippets)
        instrument = self._instruments[column, snippets]
        survey = cast(SoundedSurvey, self.survey)
        line = SoundingLine(survey, instrument, self._sensor.own_seed(self._seed), profile=profile, by=by)
        return next(line.pings([self.latest.ping]))

    @cached_property
    def _instruments(self) -> dict[tuple[bool, int], Instrument[Any]]:
        """Return the instruments of soundings by what they keep."""
        return {}

    def record(self) -> PressureRecord:
        """Return the record of the elements' signals, whose counts begin at 0."""
        made = self._record
        return PressureRecord(made.survey, seed=made.seed, ensonification=made.found)

    @cached_property
    def _record(self) -> PressureRecord:
        """Return the record that all pings share."""
        survey = self._integrator.array_survey(self._scene, self._sensor, LEAD, self._seed).stepped(self._stepping)
        return PressureRecord(survey, seed=self._sensor.own_seed(self._seed))

    def step(self, position: ArrayLike, attitude: ArrayLike, velocity: ArrayLike, turn_rate: ArrayLike,
             time: float | None) -> SteppedPing:
        """Return the next ping; raise `ValueError` for a pose that it cannot have."""
        number = 0 if self.latest is None else self.latest.ping + 1
        vectors = [_vector(name, value) for name, value in zip(POSE, (position, attitude, velocity, turn_rate))]
        place, (roll, pitch, heading) = vectors[0], vectors[1]
        when = self._checked(self.next_time if time is None else time)
        track = Track(time=[when], position=[place], roll=roll, pitch=pitch, heading=heading)
        speed, fastest = float(np.linalg.norm(vectors[2])), self.survey.planned_rates[0]
        if speed > fastest * (1 + FASTER):
            raise ValueError(f"velocity is {vectors[2].tolist()}, {speed:.4g} m/s, and the scene's route is sailed at "
                             f"{fastest:.4g} m/s at most, which the record is made for; give the sensor a higher "
                             "speed_knots")
        pose, passage, turn_rate = dict(zip(POSE, vectors)), self.survey.passage, float(np.linalg.norm(vectors[3]))
        planned = passage.platform or passage.voyage
        if (row := planned_row(planned, time=when, **pose)) is not None:
            track = Track(**{name: getattr(planned.track, name)[row:row + 1] for name in FIELDS})
            return SteppedPing(ping=number, track=track, trajectory=planned.trajectory, turn_rate=turn_rate, row=row,
                               depth_below=float(passage.depth_below[row]))
        tide = passage.tide
        if tide is not None and not tide.first <= when <= tide.last:
            raise ValueError(f"time is {when:.6g} s, and the tide of the water lasts from {tide.first:.6g} to "
                             f"{tide.last:.6g} s; give a tide that lasts longer")
        below = placement.check(self.survey.world.still, track, number, level=passage.level(track.time))
        # the trajectory is that of the reference point, as soundings are of it
        offset = planned.trajectory.offset
        arm = track.rotation()[0] @ offset
        lead = Steady(time=when, position=place - arm, attitude=vectors[1], turn_rate=vectors[3],
                      velocity=vectors[2] - np.cross(vectors[3], arm))
        return SteppedPing(ping=number, track=track, trajectory=Trajectory(lead=lead, offset=offset),
                           turn_rate=turn_rate, depth_below=float(below[0]))

    def move(self, name: str, position: ArrayLike, attitude: ArrayLike, velocity: ArrayLike, turn_rate: ArrayLike,
             time: float | None) -> None:
        """Move an object of the scene to a pose, from which it goes on at constant rates; see `mitsonar.Sonar.move`."""
        given: dict[str, ArrayLike] = dict(zip(POSE, (position, attitude, velocity, turn_rate)))
        vectors = {one: _vector(one, value) for one, value in given.items()}
        when = None if time is None else _seconds(time)
        self.survey.world.check_move(name, vectors["position"])
        for what, most, unit in (("velocity", FASTEST, "m/s"), ("turn_rate", FASTEST_TURN, "rad/s")):
            if (size := float(np.linalg.norm(vectors[what]))) > most * (1 + FASTER):
                raise ValueError(f'the {what} of "{name}" is {size:.4g} {unit}; give at most {most:.3g} {unit}')
        self._moves[name] = vectors, when

    def _checked(self, time: float) -> float:
        """Return the time of a ping [s]; refuse one before the last ping's echoes have arrived."""
        when = _seconds(time)
        last = None if self.latest is None else self.latest.time
        if last is not None and when <= last:
            raise ValueError(f"time is {when:.6g} s, and the last ping was sent at {last:.6g} s; give a later time, or "
                             "make a new sonar to begin again")
        if last is not None and when - last < self._shortest * (1 - 1e-9):
            raise ValueError(f"time is {when:.6g} s, {when - last:.4g} s after the last ping, but echoes from the "
                             f"range of the film take {self._shortest:.4f} s; wait for them, or give the film a "
                             "shorter range")
        return when


def _seconds(time: float) -> float:
    """Return a finite time [s]."""
    try:
        when = float(time)
    except (TypeError, ValueError):
        raise ValueError(f"time is {time!r}; give a number of seconds, or leave it out") from None
    if not np.isfinite(when):
        raise ValueError(f"time is {when}; give a finite number of seconds, or leave it out")
    return when


def _vector(name: str, value: ArrayLike) -> np.ndarray:
    """Return three finite numbers of a pose."""
    try:
        vector = np.array(value, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}; give three numbers") from None
    if vector.shape != (3,):
        raise ValueError(f"{name} has the shape {vector.shape}; give three numbers")
    if not np.isfinite(vector).all():
        raise ValueError(f"{name} is {vector.tolist()}; give finite numbers")
    return vector
