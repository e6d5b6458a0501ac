"""Sidescan sonar: its run over a scene, its picture, and its faces as elements."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.arrays import give_back_memory
from mitsonar.imaging import sidescan as imaging
from mitsonar.imaging.energy_record import gathered
from mitsonar.scene import objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.scene.world import World
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.faces.faces import BuiltFace
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.sonar.pulses.pulses import cw
from mitsonar.units import db_from_amplitude, db_from_power, power_from_db

from .. import limits
from ..energy import energy
from ..energy.sides import Sides
from ..energy.sidescan_survey import SidescanSurvey
from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..sensor import RunSettings, Sensor, head_speed, planned_waters, slowest_speed
from ..voyage import Passage
from .jitter import Jitter
from .speckle import speckle_of


class SidescanSensor(Sensor, Protocol):
    """Sensor of a sidescan."""

    frequency: float  # [Hz]
    source_level_db: float  # [dB re 1 µPa @ 1 m]
    pulse_length: float  # [s]: effective, after compression
    chirp_length: float  # [s]: of the transmitted pulse, at least `pulse_length`
    transmit_face: BuiltFace
    receive_face: BuiltFace
    depression_angle: float  # [rad]: of the faces' normals below horizontal
    speckle: bool
    leakage: float  # share of the other side's power in a channel
    jitter: Jitter
    self_noise_db: float | None  # [dB re 1 µPa²/Hz]: of each side's receiver


def plan(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings) -> SidescanSurvey:
    """Plan a run over a scene."""
    geometry, passage, sonar = _laid(scene, sensor)
    window, bins = sensor.film().window(sonar.sound_speed)
    waters = planned_waters(sensor, geometry, passage, sonar.frequency)
    survey = SidescanSurvey(
        world=World.of(geometry, settings.seed, passage.voyage.track, waters), waters=waters, passage=passage,
        rays=settings.rays, max_depth=settings.max_depth, sonar=sonar, window=window, bins=bins,
        first_pass=settings.first_pass, per_cell=settings.scatterers_per_cell, pass_number=sensor.pass_number)
    limits.check_sidescan(survey)
    return survey


def plan_elements(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with each side's faces as elements, port and starboard.

    The pulse is a cw of the sidescan's effective length. Faces are even and flat, regardless of the sensor's shading,
    and receive nothing from behind their own planes.
    """
    geometry, passage, sonar = _laid(scene, sensor)
    sine, cosine = np.sin(sonar.depression_angle), np.cos(sonar.depression_angle)
    transmit, receive = (element_array(
        np.zeros((2, 3)), normal=[[0, -cosine, sine], [0, cosine, sine]], along="forward", length=face.length,
        height=face.height, pattern="rectangular", baffle="hard") for face in (sonar.transmit, sonar.receive))
    # each face has the source level, and a direction receives sound from one face: both would make twice the pressure
    source_level_db = sonar.source_level_db + db_from_amplitude(2.0)
    self_noise_db = sensor.self_noise_db
    if self_noise_db is not None:
        self_noise_db = float(self_noise_db - _compression_db(sensor))
    return survey_of(
        geometry, sensor, settings, passage, lead=lead, sound_speed=sonar.sound_speed, transmit=transmit,
        receive=receive, pulse=cw(sonar.frequency, sonar.pulse_length), source_level_db=float(source_level_db),
        bins_are_samples=False, self_noise_db=self_noise_db)


def picture(survey: SidescanSurvey, sensor: SidescanSensor, seed: int,
            progress: Callable[[int, int], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the image, with its truth; see `mitsonar.render`."""
    record, classes = energy.record(survey, Sides(survey), seed, progress), classes_of(survey.labels)
    image = imaging.image(record, track=survey.track, depth_below=survey.depth_below, **_shared(survey, sensor, seed))
    if survey.world.still.large:
        give_back_memory()             # that of the speckle's tables
    return objects.annotated(image, *classes, survey.world.still, survey.track.position)


def frame(survey: SidescanSurvey, sensor: SidescanSensor, seed: int) -> Callable[[int], xr.Dataset]:
    """Return the function that renders the row of one ping of a sonar that is stepped; see `mitsonar.Sonar`."""
    blocks, shared = energy.energy_blocks(survey, Sides(survey), seed), _shared(survey, sensor, seed)
    known = objects.known(*classes_of(survey.labels), survey.world.still, survey.planned.track.position)

    def of(ping: int) -> xr.Dataset:
        record = gathered([blocks.at(ping).echoes(np.array([ping]))], pings=1, rows=2)
        image = imaging.image(record, track=survey.voyage.single.track, depth_below=survey.depth_below[-1:],
                              first=ping, **shared).assign_attrs(known)
        return image.assign_attrs(unseen=objects.unseen(image, warn=False))

    return of


def _shared(survey: SidescanSurvey, sensor: SidescanSensor, seed: int) -> dict[str, Any]:
    """Return what the images of all pings have in common, as arguments."""
    return dict(
        sonar=survey.sonar, window=survey.window, labels=survey.labels, class_of=classes_of(survey.labels)[1],
        paths=survey.paths.names, noise_db=noise_db(sensor, survey.sonar),
        speckle=speckle_of(survey, sensor.jitter, seed) if sensor.speckle else None, seed=seed,
        absorption_db=float(survey.waters.first.absorption.at(survey.planned_depth)), leakage=sensor.leakage,
        peak_window=sensor.recorder.detector.peak if sensor.recorder else 0.0)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, side, range) as rows of one picture: port mirrored, then starboard."""
    return np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)


def sonar_at(sensor: SidescanSensor, head_depth: float) -> Sidescan:
    """Return the sonar in the water at a depth of its head [m]."""
    speed = head_speed(sensor, head_depth)
    wavelength = speed / sensor.frequency
    transmit = sensor.transmit_face.aperture(wavelength)
    receive = transmit if sensor.receive_face == sensor.transmit_face else sensor.receive_face.aperture(wavelength)
    return Sidescan(frequency=sensor.frequency, source_level_db=sensor.source_level_db,
                    pulse_length=sensor.pulse_length, transmit=transmit, receive=receive,
                    depression_angle=sensor.depression_angle, sound_speed=speed)


def _compression_db(sensor: SidescanSensor) -> float:
    """Return the gain of pulse compression over noise [dB]: the transmitted length over the compressed one."""
    return float(db_from_power(sensor.chirp_length / sensor.pulse_length))


def noise_db(sensor: SidescanSensor, sonar: Sidescan) -> float | None:
    """Return ambient and receiver noise in the compressed pulse's band [dB re 1 µPa], None without noise."""
    spectra = []
    if sensor.noise:
        spectra.append(sensor.noise_level_db() - sonar.directivity_index_db())
    if sensor.self_noise_db is not None:
        spectra.append(sensor.self_noise_db)
    if not spectra:
        return None
    spectrum = float(np.sum(power_from_db(np.array(spectra))))
    return float(db_from_power(spectrum * sonar.bandwidth) - _compression_db(sensor))


def _laid(scene: mi.Scene, sensor: SidescanSensor) -> tuple[Geometry, Passage, Sidescan]:
    """Return the scene's geometry, the route laid over it, and the sonar at the route's mean depth."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
    return geometry, passage, sonar_at(sensor, float(np.mean(passage.depth)))
