"""Sidescan sonar: its run over a scene, its picture, and its faces as elements."""
from collections.abc import Callable
from typing import Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import sidescan as imaging
from mitsonar.imaging.recorder import Recorder
from mitsonar.scene import materials, objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.faces.faces import BuiltFace
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.sonar.pulses.pulses import cw
from mitsonar.units import db_from_amplitude, db_from_power, power_from_db

from .. import limits
from ..energy import energy
from ..fan import kind as array
from ..pressure.array_survey import ArraySurvey
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed
from ..voyage import Passage
from .side_speckle import side_speckle
from .sides import Sides
from .sidescan_survey import SidescanSurvey

__all__ = ["SidescanSensor", "noise_db", "picture", "plan", "plan_elements", "rows", "sonar_at"]


class SidescanSensor(Sensor, Protocol):
    """What a sidescan's sensor says, beside what all do.

    Attributes
    ----------
    frequency : float [Hz]
    source_level_db : float [dB re 1 µPa @ 1 m]
    pulse_length : float [s]
        Effective, after compression.
    chirp_length : float [s]
        Of the pulse as it is sent, at least that.
    transmit_face, receive_face : BuiltFace
    depression_angle : float [rad]
        Of the faces' normals below horizontal.
    speckle : bool
    recorder : Recorder
    self_noise_db : float or None [dB re 1 µPa²/Hz]
        Of each side's receiver.
    """

    frequency: float
    source_level_db: float
    pulse_length: float
    chirp_length: float
    transmit_face: BuiltFace
    receive_face: BuiltFace
    depression_angle: float
    speckle: bool
    recorder: Recorder
    self_noise_db: float | None


def plan(scene: "mi.Scene", sensor: SidescanSensor, settings: RunSettings) -> SidescanSurvey:
    """Plan a run over a scene.

    Raises
    ------
    ValueError
        If sensor and scene do not fit together: no seabed, a track outside it, a sonar below it, ...
    """
    geometry = Geometry(scene)
    passage = _passage(geometry, sensor)
    sonar = sonar_at(sensor, float(np.mean(passage.depth)))
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

    The pulse is a cw of the sidescan's effective length. Faces are even and flat, whatever the sensor's are, and hear
    nothing from behind their own planes; `survey.signals` knows no recorder.

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
    sonar = sonar_at(sensor, float(np.mean(passage.depth)))
    sine, cosine = np.sin(sonar.depression_angle), np.cos(sonar.depression_angle)
    transmit, receive = (element_array(
        np.zeros((2, 3)), normal=[[0, -cosine, sine], [0, cosine, sine]], along="forward", length=face.length,
        height=face.height, pattern="rectangular", baffle="hard") for face in (sonar.transmit, sonar.receive))
    # each face has the source level, and a direction hears one of them: both together would make twice the pressure
    source_level_db = sonar.source_level_db + db_from_amplitude(2.0)
    return array.survey_of(
        geometry, sensor, settings, passage, lead=lead, sound_speed=sonar.sound_speed, transmit=transmit,
        receive=receive, pulse=cw(sonar.frequency, sonar.pulse_length), source_level_db=float(source_level_db),
        bins_are_samples=False, self_noise_db=_self_noise_db(sensor))


def picture(survey: SidescanSurvey, sensor: SidescanSensor, seed: int,
            progress: Callable[[int, int], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the image, with its truth; see `mitsonar.render`."""
    record, sonar, track = energy.record(survey, Sides(survey), seed, progress), survey.sonar, survey.track
    head_depth = float(np.mean(-track.position[:, 2]))
    classes, class_of = classes_of(survey.labels)
    image = imaging.image(
        record, sonar=sonar, track=track, depth_below=survey.depth_below, window=survey.window, labels=survey.labels,
        class_of=class_of, paths=survey.paths.names, noise_db=noise_db(sensor, sonar),
        speckle=side_speckle(survey, seed).of if sensor.speckle else None, seed=seed,
        absorption_db=float(survey.absorption.at(head_depth)), recorder=sensor.recorder)
    return objects.annotated(image, classes, class_of, survey.geometry, survey.track.position)


def rows(level: np.ndarray) -> np.ndarray:
    """Levels (ping, side, range) as rows of one picture: port mirrored, then starboard."""
    return np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)


def sonar_at(sensor: SidescanSensor, head_depth: float) -> Sidescan:
    """Return the sonar as its head meets the water at a depth [m]."""
    speed = head_speed(sensor, head_depth)
    wavelength = speed / sensor.frequency
    transmit = sensor.transmit_face.aperture(wavelength)
    receive = transmit if sensor.receive_face == sensor.transmit_face else sensor.receive_face.aperture(wavelength)
    return Sidescan(frequency=sensor.frequency, source_level_db=sensor.source_level_db,
                    pulse_length=sensor.pulse_length, transmit=transmit, receive=receive,
                    depression_angle=sensor.depression_angle, sound_speed=speed)


def _self_noise_db(sensor: SidescanSensor) -> float | None:
    """Noise of a receiver [dB re 1 µPa²/Hz], less what compression of the pulse gains."""
    if sensor.self_noise_db is None:
        return None
    return float(sensor.self_noise_db - _compression_db(sensor))


def _compression_db(sensor: SidescanSensor) -> float:
    """Gain of compression over noise [dB]: how much longer the pulse is when it is sent."""
    return float(db_from_power(sensor.chirp_length / sensor.pulse_length))


def noise_db(sensor: SidescanSensor, sonar: Sidescan) -> float | None:
    """Noise of the sea and of the receiver in the compressed pulse's band [dB re 1 µPa]; None where there is none."""
    spectra = []
    if sensor.noise:
        spectra.append(sensor.noise_level_db() - sonar.directivity_index_db())
    if sensor.self_noise_db is not None:
        spectra.append(sensor.self_noise_db)
    if not spectra:
        return None
    spectrum = float(np.sum(power_from_db(np.array(spectra))))
    return float(db_from_power(spectrum * sonar.bandwidth) - _compression_db(sensor))


def _passage(geometry: Geometry, sensor: Sensor) -> Passage:
    return sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
