"""Sidescan sonar: its run over a scene, its picture, and its faces as elements."""
from collections.abc import Callable
from typing import Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from ..imaging import sidescan as imaging
from ..scene import materials, objects
from ..scene.geometry import Geometry
from ..scene.labels import classes_of
from ..sonar.array_makers import element_array
from ..sonar.directivity import Aperture, length_for_beam_width
from ..sonar.pulses import cw
from ..sonar.sidescan import Sidescan
from ..units import db_from_amplitude, db_from_power
from . import array, energy, limits
from .array_survey import ArraySurvey
from .sensor import RunSettings, Sensor, slowest_speed
from .sides import Sides
from .side_speckle import side_speckle
from .sidescan_survey import SidescanSurvey
from .voyage import Passage

__all__ = ["SidescanSensor", "picture", "plan", "plan_elements", "rows", "sonar_at"]


class SidescanSensor(Sensor, Protocol):
    """What a sidescan's sensor says, beside what all do.

    Attributes
    ----------
    frequency : float [Hz]
    source_level_db : float [dB re 1 µPa @ 1 m]
    pulse_length : float [s]
        Effective, after compression.
    transmit_widths, receive_widths : (float, float) [rad]
        Full one-way -3 dB widths along and across the platform.
    depression_angle : float [rad]
        Of the faces' normals below horizontal.
    speckle : bool
    """

    frequency: float
    source_level_db: float
    pulse_length: float
    transmit_widths: tuple[float, float]
    receive_widths: tuple[float, float]
    depression_angle: float
    speckle: bool


def plan(scene: "mi.Scene", sensor: SidescanSensor, settings: RunSettings) -> SidescanSurvey:
    """Plan a run over a scene.

    Raises
    ------
    ValueError
        If sensor and scene do not fit together: no seabed, a track outside it, a sonar below it, ...
    """
    geometry = Geometry(scene)
    passage = _passage(geometry, sensor)
    sonar = sonar_at(sensor, _mean_depth(passage))
    window, bins = sensor.film().window(sonar.sound_speed)
    materials.check(geometry, sensor.water.profile, sonar.frequency)
    survey = SidescanSurvey(
        geometry=geometry, profile=sensor.water.profile, absorption=sensor.water.absorption_column(sonar.frequency),
        volume=sensor.water.volume, passage=passage, rays=settings.rays, max_depth=settings.max_depth, sonar=sonar,
        window=window, bins=bins, first_pass=settings.first_pass)
    limits.check_sidescan(survey)
    return survey


def plan_elements(scene: "mi.Scene", sensor: SidescanSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with each side's faces as elements, port and starboard.

    The pulse is a cw of the sidescan's effective length. A face hears nothing from behind its own plane.

    Parameters
    ----------
    lead : float [-]
        How many pulses earlier than the film's window the record starts: echoes that begin before it last into it.

    Raises
    ------
    ValueError
        As `plan`, or if the samples are too few for the pulse.
    """
    geometry = Geometry(scene)
    passage = _passage(geometry, sensor)
    sonar = sonar_at(sensor, _mean_depth(passage))
    sine, cosine = np.sin(sonar.depression_angle), np.cos(sonar.depression_angle)
    transmit, receive = (element_array(
        np.zeros((2, 3)), normal=[[0, -cosine, sine], [0, cosine, sine]], along="forward", length=face.length,
        height=face.height, pattern="rectangular", baffle="hard") for face in (sonar.transmit, sonar.receive))
    # each face has the source level, and a direction hears one of them: both together would make twice the pressure
    source_level_db = sonar.source_level_db + db_from_amplitude(2.0)
    return array.survey_of(
        geometry, sensor, settings, passage, lead=lead, sound_speed=sonar.sound_speed, transmit=transmit,
        receive=receive, pulse=cw(sonar.frequency, sonar.pulse_length), source_level_db=float(source_level_db),
        bins_are_samples=False, self_noise_db=None)


def picture(survey: SidescanSurvey, sensor: SidescanSensor, seed: int,
            progress: Callable[[int, int], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the image, with its truth; see `mitsonar.render`."""
    record, sonar, track = energy.record(survey, Sides(survey), seed, progress), survey.sonar, survey.track
    noise_db = None
    if sensor.noise:
        noise_db = float(sensor.noise_level_db() + db_from_power(sonar.bandwidth) - sonar.directivity_index_db())
    head_depth = float(np.mean(-track.position[:, 2]))
    classes, class_of = classes_of(survey.labels)
    image = imaging.image(
        record, sonar=sonar, track=track, depth_below=survey.depth_below, window=survey.window, labels=survey.labels,
        class_of=class_of, paths=survey.paths.names, noise_db=noise_db,
        speckle=side_speckle(survey, seed).of if sensor.speckle else None, seed=seed,
        absorption_db=float(survey.absorption.at(head_depth)))
    return objects.annotated(image, classes, class_of, survey.geometry)


def rows(level: np.ndarray) -> np.ndarray:
    """Levels (ping, side, range) as rows of one picture: port mirrored, then starboard."""
    return np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)


def sonar_at(sensor: SidescanSensor, head_depth: float) -> Sidescan:
    """The sonar as its head meets the water at a depth [m]."""
    speed = sensor.sound_speed or float(sensor.water.profile.at(head_depth))
    wavelength = speed / sensor.frequency
    transmit, receive = (Aperture(length=length_for_beam_width(along, wavelength),
                                  height=length_for_beam_width(across, wavelength))
                         for along, across in (sensor.transmit_widths, sensor.receive_widths))
    return Sidescan(frequency=sensor.frequency, source_level_db=sensor.source_level_db,
                    pulse_length=sensor.pulse_length, transmit=transmit, receive=receive,
                    depression_angle=sensor.depression_angle, sound_speed=speed)


def _passage(geometry: Geometry, sensor: Sensor) -> Passage:
    return sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])


def _mean_depth(passage: Passage) -> float:
    return float(np.mean(-passage.voyage.track.position[:, 2]))
