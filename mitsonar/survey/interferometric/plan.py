"""Planning of an interferometric sidescan's run: one route, and a survey of arrays for each side over the same scene.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import mitsuba as mi
import numpy as np

from mitsonar.hydrography.detection.row_angles import ReceiverRows, sector_of
from mitsonar.scene.geometry import Geometry
from mitsonar.signal.matched_filtering import compression, rms_bandwidth
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.units import db_from_amplitude

from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.signals import LEAD
from ..sensor import RunSettings, head_speed, slowest_speed
from ..soundings.survey import SoundedSurvey, SoundingSensor, Transmission, shared

SIDES = ("port", "starboard")


@dataclass(frozen=True, kw_only=True, eq=False)
class InterferometricSurvey(SoundedSurvey):
    """Run of an interferometric sidescan."""

    sides: tuple[ArraySurvey, ArraySurvey]  # port and starboard
    bins: int  # of each side's record; each makes a sounding
    rows: ReceiverRows  # of each side
    looks: float  # range cells that phases are averaged over, at least
    least_coherence: float  # of a valid sounding

    def _made_within(self, ping: int) -> InterferometricSurvey:
        """Return a new survey in which all pings, of both sides, have the surroundings of one."""
        port, starboard = self.sides
        return replace(super()._made_within(ping), sides=(port.within(ping), starboard.within(ping)))

    @property
    def per_bin(self) -> int:
        """Return the number of samples in a bin."""
        return (self.sides[0].samples - self.sides[0].lead) // self.bins

    @cached_property
    def relative_bandwidth(self) -> float:
        """Return the width over the carrier of a flat band that has the rms bandwidth of the compressed pulse."""
        side = self.sides[0]
        return float(np.sqrt(12) * rms_bandwidth(side.pulse, side.sampling_rate) / side.frequency)

    @cached_property
    def pulse_length(self) -> float:
        """Return ∫|χ|² dt of the compressed pulse [s]."""
        return float(compression(self.sides[0].pulse, self.sides[0].sampling_rate)[0])

    @property
    def window(self) -> int:
        """Return the number of samples over which phases are averaged."""
        per_bin, wanted = self.per_bin, int(np.ceil(self.looks * self.pulse_length * self.sides[0].sampling_rate))
        return per_bin + 2 * max(0, -(-(wanted - per_bin) // 2))

    @property
    def time(self) -> np.ndarray:
        """Return the times of the bins' middles (bins,) [s]."""
        side = self.sides[0]
        return side.time[side.lead:].reshape(self.bins, -1).mean(1)

    @property
    def transmissions(self) -> Sequence[Transmission]:
        """Return a transmission for each side, at one time; soundings go from port's last bin to starboard's last."""
        pings = self.track.pings
        return [Transmission(survey=side, delay=0.0, sines=np.zeros(pings),
                             beams=slice(k * self.bins, (k + 1) * self.bins)) for k, side in enumerate(self.sides)]


SAMPLES = 2.0, 3.0                 # sampling rate over the pulse's bandwidth, of sweeps (steep skirts) and other pulses
SWEEP = 4.0                        # least duration times bandwidth of a sweep


class InterferometricSensor(SoundingSensor, Protocol):
    """Sensor of an interferometric sidescan.

    Attributes
    ----------
    source_level_db : float [dB re 1 µPa @ 1 m]
        Level of each side on its axis.
    pulse : Pulse
    transmit, receive : (Array, Array)
        Faces to port and starboard; the rows of `receive` go from the lowest up.
    tilt : float [rad]
        Angle of the faces' normals below the horizontal.
    looks, least_coherence
        See `InterferometricSurvey`.
    """

    source_level_db: float
    pulse: Pulse
    transmit: tuple[Array, Array]
    receive: tuple[Array, Array]
    tilt: float
    looks: float
    least_coherence: float


def plan(scene: mi.Scene, sensor: InterferometricSensor, settings: RunSettings,
         lead: float = LEAD) -> InterferometricSurvey:
    """Plan a run over a scene; the record begins `lead` pulse lengths early."""
    sides = [_run(scene, sensor, settings, lead, transmit, receive, sensor.source_level_db)
             for transmit, receive in zip(sensor.transmit, sensor.receive)]
    port, starboard = sides
    place = (starboard.receive.position - starboard.receive.position.mean(0)) @ up_along(starboard.receive)
    _, bins = sensor.film().window(head_speed(sensor, port.passage.depth))
    return InterferometricSurvey(
        **shared(port, port.passage, sensor, settings), sides=(port, starboard), bins=bins, looks=sensor.looks,
        rows=ReceiverRows(place=place / port.wavelength, sector=sector_of(sensor.tilt)),
        least_coherence=sensor.least_coherence)


def plan_elements(scene: mi.Scene, sensor: InterferometricSensor, settings: RunSettings,
                  lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with the faces of both sides as elements: those of port, then those of starboard."""
    transmit, receive = (element_array(
        np.concatenate([side.position for side in sides]), normal=np.concatenate([side.normal for side in sides]),
        along="forward", length=sides[0].length, height=sides[0].height, pattern=sides[0].pattern,
        baffle=sides[0].baffle) for sides in (sensor.transmit, sensor.receive))
    # only one side sends in a direction, at the source level; the level of an array is that of all elements in phase
    level = sensor.source_level_db + float(db_from_amplitude(2.0))
    return _run(scene, sensor, settings, lead, transmit, receive, level)


def up_along(receive: Array) -> np.ndarray:
    """Return the unit vector up the face along which the rows are placed, body frame."""
    across = np.cross(receive.normal[0], receive.along[0])
    return across * -np.sign(across[2])


def _run(scene: mi.Scene, sensor: InterferometricSensor, settings: RunSettings, lead: float, transmit: Array,
         receive: Array, source_level_db: float) -> ArraySurvey:
    """Return the survey of faces."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
    speed = head_speed(sensor, passage.depth)
    samples = SAMPLES[0 if sensor.pulse.duration * sensor.pulse.bandwidth > SWEEP else 1]
    rate = min(samples * sensor.pulse.bandwidth, sensor.pulse.suggested_sampling_rate)
    return survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=speed, transmit=transmit,
                     receive=receive, pulse=sensor.pulse, source_level_db=source_level_db, bins_are_samples=False,
                     whole_bins=True, self_noise_db=sensor.self_noise_db, usual_rate=rate)
