"""Planning of a multibeam echo sounder's run: one route, and for every sector a run of arrays over the same scene.

Where a swath's beams and transmissions are steered to, ping by ping.

A beam listens along the angle θ from the vertical, to starboard, in the vertical plane across the track, and its echo
comes in at t_r = t + 2 h / (c cos θ). The sine on the receiving line of axis a_r, and that of a transmission towards
the sector's middle θ_k, tilted by φ forward of that plane, on the transmitting line of axis a_t, are

    s_r = a_r(t_r)·(ŝ sin θ + d̂ cos θ)          s_t = a_t(t)·(f̂ sin φ + (ŝ sin θ_k + d̂ cos θ_k) cos φ)           (1)

f̂, ŝ, d̂ -> forward, starboard and down, level, by the heading; where yaw is compensated, by the mean heading of 20 s
about the ping. Without compensation of roll beams keep their angles in the body; without that of pitch transmissions
keep their tilt from the head's own plane.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import mitsuba as mi
import numpy as np

from mitsonar.scene import materials
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.sectors import Sector
from mitsonar.sonar.motion.track import mounting_matrix, rotation_matrix
from mitsonar.sonar.motion.trajectory import Trajectory, Voyage
from mitsonar.sonar.pulses.pulse import Pulse

from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.signals import LEAD
from ..sensor import RunSettings, head_speed, slowest_speed
from ..soundings.survey import SectorRun, SoundingSensor, SwathSurvey, shared
from ..voyage import Passage

COURSE = np.linspace(-10, 10, 9)   # [s] about a ping, over which headings are averaged
STEEPEST = np.deg2rad(85.0)        # angle beyond which an echo's time is no longer foreseen
WIDEST = np.sin(np.deg2rad(89.0))  # sine that beams are steered to at most


@dataclass(frozen=True, kw_only=True)
class Stabilised:
    """Hold which motions the steering compensates."""

    roll: bool
    pitch: bool
    yaw: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Swath:
    """Compute the steering of beams and transmissions."""

    trajectory: Trajectory  # of the sonar
    mounting: np.ndarray  # (3,) [rad]: roll, pitch, heading of the head
    stabilised: Stabilised

    def receive_sines(self, sector: Sector, times: np.ndarray, depth: np.ndarray, sound_speed: float) -> np.ndarray:
        """Return s_r of (1) of a sector's beams at its transmissions."""
        # times (P,) [s]; depth (P,) [m]; sound_speed [m/s] -> (P, B)
        angle = np.broadcast_to(sector.beams, (len(times), len(sector.beams)))
        if not self.stabilised.roll:
            in_body = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], -1)
            return np.clip(in_body @ mounting_matrix(*self.mounting)[:, 1], -WIDEST, WIDEST)
        received = times[:, None] + 2 * depth[:, None] / (sound_speed * np.cos(np.clip(angle, -STEEPEST, STEEPEST)))
        axis = self._axes(received, times[:, None])[..., 1]
        _, starboard, down = self._frame(times)
        towards = np.sin(angle)[..., None] * starboard[:, None] + np.cos(angle)[..., None] * down[:, None]
        return np.clip(np.sum(axis * towards, -1), -WIDEST, WIDEST)

    def transmit_sines(self, sector: Sector, times: np.ndarray) -> np.ndarray:
        """Return s_t of (1) at a sector's transmissions (P,) [s]: (P,)."""
        if not self.stabilised.pitch:
            return np.full(len(times), np.sin(sector.tilt))
        forward, starboard, down = self._frame(times)
        across = np.sin(sector.middle) * starboard + np.cos(sector.middle) * down
        towards = np.sin(sector.tilt) * forward + np.cos(sector.tilt) * across
        return np.sum(self._axes(times, times)[..., 0] * towards, -1)

    def _axes(self, times: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Return head to scene at times (...): (..., 3, 3)."""
        _, attitude = self.trajectory.pose(times, np.broadcast_to(since, times.shape))
        return rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ mounting_matrix(*self.mounting)

    def _frame(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return f̂, ŝ and d̂ at transmissions (P,), each (P, 3), scene."""
        _, attitude = self.trajectory.pose(times)
        heading = attitude[:, 2]
        if self.stabilised.yaw:
            around = times[:, None] + COURSE
            turned = self.trajectory.pose(around, np.broadcast_to(times[:, None], around.shape))[1][..., 2]
            heading = np.arctan2(np.sin(turned).mean(1), np.cos(turned).mean(1))
        level = np.zeros_like(heading)
        frame = rotation_matrix(level, level, heading)
        return frame[..., 0], frame[..., 1], frame[..., 2]


SAMPLES = 3.0                      # to one over a pulse's bandwidth: 0.8 of them are flat, a cw's main lobe 2.26


class MultibeamSensor(SoundingSensor, Protocol):
    """Define the sensor of a multibeam echo sounder.

    Attributes
    ----------
    sectors : tuple of Sector
    transmit : tuple of Array
        One a sector.
    receive : Array
    mounting : (3,) [rad]
        Roll, pitch, heading of the head.
    stabilised : (bool, bool, bool)
        Roll, pitch, yaw.
    receive_flaws : float
        As of `SwathSurvey`.
    """

    sectors: tuple[Sector, ...]
    transmit: tuple[Array, ...]
    receive: Array
    mounting: np.ndarray
    stabilised: tuple[bool, bool, bool]
    receive_flaws: float


def plan(scene: mi.Scene, sensor: MultibeamSensor, settings: RunSettings, lead: float = LEAD) -> SwathSurvey:
    """Plan a run over a scene; `lead` as of `survey.array.plan_elements`."""
    geometry = Geometry(scene)
    last = max(sector.delay for sector in sensor.sectors)
    middle = 0.5 * (sensor.transmit[0].position.mean(0) + sensor.receive.position.mean(0))
    # legs start midway between the arrays: what they differ by on the way to either is smallest
    route = replace(sensor.route, offset=sensor.route.offset + middle)
    passage = route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1] + last)
    speed = head_speed(sensor, passage.depth)
    for sector in sensor.sectors:
        materials.check(geometry, sensor.water.profile, sector.pulse.frequency)
    runs = _alike([_of_a_sector(geometry, sensor, settings, passage, speed, k, lead, middle)
                   for k in range(len(sensor.sectors))], lead)
    swath = Swath(trajectory=passage.voyage.trajectory, mounting=sensor.mounting,
                  stabilised=Stabilised(roll=sensor.stabilised[0], pitch=sensor.stabilised[1],
                                        yaw=sensor.stabilised[2]))
    sectors, first = [], 0
    for sector, array, survey in zip(sensor.sectors, sensor.transmit, runs):
        steered = _steered(sector, array, survey, swath, sensor, speed, first)
        sectors.append(steered)
        first += len(sector.beams)
    return SwathSurvey(**shared(sectors[0].survey, passage, sensor, settings), sectors=tuple(sectors),
                       mounting=sensor.mounting, receive_flaws=sensor.receive_flaws)


def _of_a_sector(geometry: Geometry, sensor: MultibeamSensor, settings: RunSettings, passage: Passage, speed: float,
                 number: int, lead: float, middle: np.ndarray) -> ArraySurvey:
    """The run of a sector's arrays, before it is steered; `middle` (3,) [m] is where its track leads, body frame."""
    sector = sensor.sectors[number]
    track = passage.voyage.track
    later = passage
    if sector.delay:
        later = replace(passage, voyage=Voyage.of(passage.voyage.trajectory, track.time + sector.delay))
    return survey_of(geometry, sensor, settings, later, lead=lead, sound_speed=speed,
                     transmit=sensor.transmit[number].moved(-middle), receive=sensor.receive.moved(-middle),
                     pulse=sector.pulse, source_level_db=sector.source_level_db, bins_are_samples=True,
                     self_noise_db=sensor.self_noise_db, usual_rate=_rate(sector.pulse))


def _rate(pulse: Pulse) -> float:
    """Sampling rate [Hz] of an instrument: its receiver passes the main lobe of a pulse's spectrum, not the skirts."""
    return min(SAMPLES * pulse.bandwidth, pulse.suggested_sampling_rate)


def _alike(runs: list[ArraySurvey], longest: float) -> list[ArraySurvey]:
    """Let all runs be sampled at the highest rate, from the same time on: their beams stand in one picture."""
    rate = max(run.sampling_rate for run in runs)
    begin = runs[0].start + runs[0].lead / runs[0].sampling_rate
    samples = max(int(np.ceil((run.samples - run.lead) * rate / run.sampling_rate - 1e-9)) for run in runs)
    alike = []
    for run in runs:
        lead = int(np.ceil(longest * run.pulse.duration * rate))
        noise = None if run.noise is None else replace(run.noise, sampling_rate=rate)
        alike.append(replace(run, sampling_rate=rate, samples=samples + lead, lead=lead, start=begin - lead / rate,
                             noise=noise))
    return alike


def _steered(sector: Sector, array: Array, survey: ArraySurvey, swath: Swath, sensor: MultibeamSensor, speed: float,
             first: int) -> SectorRun:
    times = survey.track.time
    there = survey.profile.at(-survey.track.position[:, 2])
    # delays are made with the head's sound speed, so that beams look where the true one puts them
    astray = there / (there + sensor.head_speed_error)
    sines = swath.receive_sines(sector, times, survey.depth_below, speed) * astray[:, None]
    sent = swath.transmit_sines(sector, times) * astray
    along = array.along[0]
    return SectorRun(sector=sector, survey=replace(survey, steering=sent[:, None] * along), sines=sines,
                     said=1 / astray, transmit_sines=sent, first=first)
