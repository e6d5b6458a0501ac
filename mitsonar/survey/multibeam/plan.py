"""Planning of a multibeam's run: one route, a survey of arrays for every sector, and the steering of every ping.

A beam receives along the angle θ from the vertical, to starboard, in the vertical plane across the track, and its echo
arrives at t_r = t + 2 h / (c cos θ). The sine on the receiving line of axis a_r, and that of a transmission towards
the sector's middle θ_k, tilted by φ forward of that plane, on the transmitting line of axis a_t, are

    s_r = a_r(t_r)·(ŝ sin θ + d̂ cos θ)          s_t = a_t(t)·(f̂ sin φ + (ŝ sin θ_k + d̂ cos θ_k) cos φ)           (1)

f̂, ŝ, d̂ -> level unit vectors forward, to starboard and down, by the heading, or by the mean heading of 20 s about the
ping where yaw is compensated. Without roll compensation beams keep their angles in the body; without pitch
compensation transmissions keep their tilt from the head's own plane.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import mitsuba as mi
import numpy as np

from mitsonar.device.rotations import mounting_matrix, rotation_matrix
from mitsonar.hydrography.detection.written_strength import StrengthWriting
from mitsonar.imaging.recorder import Recorder
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.sectors import Sector
from mitsonar.sonar.motion.stepping import voyage_of
from mitsonar.sonar.motion.trajectory import Trajectory, Voyage

from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.signals import LEAD
from ..sensor import RunSettings, head_speed, slowest_speed
from ..soundings.survey import Aim, SectorAim, SectorRun, SoundingSensor, SwathSurvey, shared
from ..voyage import Passage

COURSE = np.linspace(-10, 10, 9)   # [s] times about a ping over which headings are averaged
STEEPEST = np.deg2rad(85.0)        # largest beam angle for which the time of the echo is predicted
WIDEST = np.sin(np.deg2rad(89.0))  # largest sine of a steered beam
SAMPLES = 3.0                      # sampling rate over the pulse's bandwidth: 0.8 of it is flat, a cw's main lobe 2.26


@dataclass(frozen=True, kw_only=True, eq=False)
class Swath:
    """Steering of beams and transmissions."""

    trajectory: Trajectory  # of the sonar
    mounting: np.ndarray  # (3,) [rad], roll, pitch, heading of the head
    stabilised: tuple[bool, bool, bool]  # roll, pitch, yaw: True if the steering compensates the motion

    def receive_sines(self, sector: Sector, times: np.ndarray, depth: np.ndarray, sound_speed: float) -> np.ndarray:
        """Return s_r of (1) for a sector's beams and transmissions."""
        # times (P,) [s]; depth (P,) [m]; sound_speed [m/s] -> (P, B)
        angle = np.broadcast_to(sector.beams, (len(times), len(sector.beams)))
        if not self.stabilised[0]:
            in_body = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], -1)
            return np.clip(in_body @ mounting_matrix(*self.mounting)[:, 1], -WIDEST, WIDEST)
        received = times[:, None] + 2 * depth[:, None] / (sound_speed * np.cos(np.clip(angle, -STEEPEST, STEEPEST)))
        axis = self._axes(received, times[:, None])[..., 1]
        _, starboard, down = self._frame(times)
        towards = np.sin(angle)[..., None] * starboard[:, None] + np.cos(angle)[..., None] * down[:, None]
        return np.clip(np.sum(axis * towards, -1), -WIDEST, WIDEST)

    def transmit_sines(self, sector: Sector, times: np.ndarray) -> np.ndarray:
        """Return s_t of (1), (P,), for a sector's transmissions at times (P,) [s]."""
        if not self.stabilised[1]:
            return np.full(len(times), np.sin(sector.tilt))
        forward, starboard, down = self._frame(times)
        across = np.sin(sector.middle) * starboard + np.cos(sector.middle) * down
        towards = np.sin(sector.tilt) * forward + np.cos(sector.tilt) * across
        return np.sum(self._axes(times, times)[..., 0] * towards, -1)

    def _axes(self, times: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Return the rotations (..., 3, 3) from head to scene at times (...) [s]."""
        _, attitude = self.trajectory.pose(times, np.broadcast_to(since, times.shape))
        return rotation_matrix(*np.moveaxis(attitude, -1, 0)) @ mounting_matrix(*self.mounting)

    def _frame(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return f̂, ŝ and d̂ at transmissions (P,), each (P, 3), scene frame."""
        _, attitude = self.trajectory.pose(times)
        heading = attitude[:, 2]
        if self.stabilised[2]:
            around = times[:, None] + COURSE
            turned = self.trajectory.pose(around, np.broadcast_to(times[:, None], around.shape))[1][..., 2]
            heading = np.arctan2(np.sin(turned).mean(1), np.cos(turned).mean(1))
        level = np.zeros_like(heading)
        frame = rotation_matrix(level, level, heading)
        return frame[..., 0], frame[..., 1], frame[..., 2]


class MultibeamSensor(SoundingSensor, Protocol):
    """Sensor of a multibeam echo sounder.

    Attributes
    ----------
    sectors : tuple of Sector
    transmit : tuple of Array
        Transmit array of every sector.
    receive : Array
    mounting : (3,) [rad]
        Roll, pitch, heading of the head.
    stabilised : (bool, bool, bool)
        True for each of roll, pitch and yaw that the steering compensates.
    receive_flaws : float
        See `SwathSurvey`.
    strength_writing : StrengthWriting or None
    column_recorder : Recorder or None
    """

    sectors: tuple[Sector, ...]
    transmit: tuple[Array, ...]
    receive: Array
    mounting: np.ndarray
    stabilised: tuple[bool, bool, bool]
    receive_flaws: float
    strength_writing: StrengthWriting | None
    column_recorder: Recorder | None


def plan(scene: mi.Scene, sensor: MultibeamSensor, settings: RunSettings, lead: float = LEAD) -> SwathSurvey:
    """Plan a run over a scene; the record begins `lead` pulse lengths early."""
    geometry = Geometry(scene)
    last = max(sector.delay for sector in sensor.sectors)
    middle = 0.5 * (sensor.transmit[0].position.mean(0) + sensor.receive.position.mean(0))
    # rays start midway between the arrays, where the differences to the ways of both are smallest
    route = replace(sensor.route, offset=sensor.route.offset + middle)
    passage = route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1] + last)
    speed = head_speed(sensor, passage.depth)
    runs = _alike([_of_a_sector(geometry, sensor, settings, passage, speed, k, lead, middle)
                   for k in range(len(sensor.sectors))], lead)
    sectors, first = [], 0
    for sector, array, survey in zip(sensor.sectors, sensor.transmit, runs):
        aim = SectorAim(survey=survey, find=partial(_aim, sector, sensor, speed), along=array.along[0])
        sectors.append(SectorRun(sector=sector, survey=replace(survey, steering=aim), aim=aim, first=first))
        first += len(sector.beams)
    return SwathSurvey(**shared(sectors[0].survey, passage, sensor, settings), sectors=tuple(sectors),
                       mounting=sensor.mounting, receive_flaws=sensor.receive_flaws,
                       strength_writing=sensor.strength_writing, column_recorder=sensor.column_recorder)


def _of_a_sector(geometry: Geometry, sensor: MultibeamSensor, settings: RunSettings, passage: Passage, speed: float,
                 number: int, lead: float, middle: np.ndarray) -> ArraySurvey:
    """Return the survey of a sector's arrays before steering; its track is that of `middle` (3,) [m], body frame."""
    sector, later, voyage = sensor.sectors[number], passage, passage.voyage
    if sector.delay:
        later = replace(passage, voyage=Voyage.of(voyage.trajectory, voyage.track.time + sector.delay),
                        of_ping=partial(voyage_of, later=sector.delay))
    # an instrument's receiver passes the main lobe of a pulse's spectrum, not its skirts
    rate = min(SAMPLES * sector.pulse.bandwidth, sector.pulse.suggested_sampling_rate)
    return survey_of(geometry, sensor, settings, later, lead=lead, sound_speed=speed,
                     transmit=sensor.transmit[number].moved(-middle), receive=sensor.receive.moved(-middle),
                     pulse=sector.pulse, source_level_db=sector.source_level_db, bins_are_samples=True,
                     self_noise_db=sensor.self_noise_db, usual_rate=rate)


def _alike(runs: list[ArraySurvey], longest: float) -> list[ArraySurvey]:
    """Return the runs sampled at their highest rate from one time on, because their beams share a picture."""
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


def _aim(sector: Sector, sensor: MultibeamSensor, speed: float, voyage: Voyage, below: np.ndarray,
         there: np.ndarray) -> Aim:
    """Return the aim of a sector, in beams of a sound speed [m/s], where the sonar is; arguments as of `SectorAim`."""
    swath = Swath(trajectory=voyage.trajectory, mounting=sensor.mounting, stabilised=sensor.stabilised)
    times = voyage.track.time
    # steering delays use the head's sound speed; the true sound speed decides where the beams look
    astray = there / (there + sensor.head_speed_error)
    return Aim(sines=swath.receive_sines(sector, times, below, speed) * astray[:, None], said=1 / astray,
               transmit_sines=swath.transmit_sines(sector, times) * astray)
