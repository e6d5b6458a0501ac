"""Sonar with arrays: its run over a scene, and the picture of its fan of beams."""
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.pulses.pulses import Pulse

from ..beam_domain.fan_pictures import FanPictures
from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.signals import LEAD
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed


class ArraySensor(Sensor, Protocol):
    """Sensor of a sonar with arrays.

    Attributes
    ----------
    source_level_db : float [dB re 1 µPa @ 1 m]
        Level of the whole transmit array in its steering direction.
    pulse : Pulse
    transmit, receive : Array
        Arrays whose steering delays are made for `nominal_sound_speed`.
    nominal_sound_speed : float [m/s]
    steering_delays : ((T,), (E,)) [s]
        Original steering delays of both arrays; they are scaled to the sound speed at the head.
    delays_from_file : (bool, bool)
        True where the delays of the transmit or receive array come from a file: they are times and are not scaled.
    beams : int
        Number of beams of the picture's fan.
    fan_width : float [rad]
        Angle from the first to the last beam.
    self_noise_db : float or None [dB re 1 µPa²/Hz]
        Noise of each receiver.
    picture : {"beams", "elements"} or None
        Method of making the picture; None: the beam domain where it can be used, else the signals of the elements.
    """

    source_level_db: float
    pulse: Pulse
    transmit: Array
    receive: Array
    nominal_sound_speed: float
    steering_delays: tuple[np.ndarray, np.ndarray]
    delays_from_file: tuple[bool, bool]
    beams: int
    fan_width: float
    self_noise_db: float | None
    picture: str | None


def plan(scene: "mi.Scene", sensor: ArraySensor, settings: RunSettings) -> ArraySurvey:
    """Plan a run for a picture: its record begins a pulse early; see `plan_elements`."""
    return plan_elements(scene, sensor, settings, LEAD)


def plan_elements(scene: "mi.Scene", sensor: ArraySensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan a run over a scene; its record begins `lead` pulse lengths early."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
    speed = head_speed(sensor, passage.depth)
    # Steering delays are lengths over a speed. Delays of a file, and later changes of any delay, are times.
    transmit, receive = (
        array if from_file else replace(
            array, delay=steering * (sensor.nominal_sound_speed / speed) + (array.delay - steering))
        for array, steering, from_file in zip((sensor.transmit, sensor.receive), sensor.steering_delays,
                                              sensor.delays_from_file))
    return survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=speed, transmit=transmit,
                     receive=receive, pulse=sensor.pulse, source_level_db=sensor.source_level_db,
                     bins_are_samples=True, self_noise_db=sensor.self_noise_db)


def picture(survey: ArraySurvey, sensor: ArraySensor, seed: int, progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the array's beams, with its truth; see `mitsonar.render`."""
    return FanPictures(survey, directions(survey, sensor), seed=seed, way=sensor.picture).whole(progress, say)


def frame(survey: ArraySurvey, sensor: ArraySensor, seed: int) -> Callable[[int], xr.Dataset]:
    """Return the function that renders the picture of one ping; see `mitsonar.frames`."""
    return FanPictures(survey, directions(survey, sensor), seed=seed, way=sensor.picture).of


def directions(survey: ArraySurvey, sensor: ArraySensor) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (B,) [rad] and directions (B, 3) of the picture's beams, body frame."""
    return fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, beam, sample) as rows of one picture, ping after ping."""
    return level.reshape(-1, level.shape[-1])
