"""Sidescan sonar: its run over a scene, its picture, its faces as elements, and the speckle of its pings."""
from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.echoes.scatterers.ground_speckle import LATTICES, GroundSpeckle, SpeckleBeam, SpeckleWay
from mitsonar.imaging import sidescan as imaging
from mitsonar.imaging.recorder import Recorder
from mitsonar.imaging.sidescan import speckle_gates
from mitsonar.scene import objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.scene.world import World
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.faces.faces import BuiltFace
from mitsonar.sonar.faces.near_field import near_pressure
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.sonar.motion.track import rotation_matrix
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

WIDEST = 0.2                       # cosine at which lobes are cut: pings are too far apart for wider lobes to matter
LOBE_END = 1e-3                    # two-way intensity at which the main lobe ends (-30 dB)
STEP = 1 / 32                      # step of cosines, in wavelengths over the face's length
NODES = 64                         # nodes in a lobe's table
PER_OCTAVE = 6.0                   # ranges of the beam's table
NEAREST, NEAREST_LENGTHS = 0.5, 0.5      # [m], and in lengths of the face: shortest range of the beam's table
LEVEL_OVER = 20.0                  # [m] of the track over which the bed's depth is averaged
ALONG = 0.75                       # share of the lattices' spacing beyond which a course takes another lattice
STRETCH = 64                       # pings among which the end of a stretch is first searched
TIMES = np.array([0.0, 0.5, 1.0])  # moments of the record, as shares of its duration


def side_speckle(survey: SidescanSurvey, seed: int) -> GroundSpeckle:
    """Return the source of a survey's speckle."""
    sonar, (start, end) = survey.sonar, survey.window
    gates = survey.bins * speckle_gates(survey.bin_length, sonar.pulse_length)
    to_range = 0.5 * sonar.sound_speed
    return GroundSpeckle(
        way=_way(survey), beam=main_lobe(sonar, to_range * end), wavenumber=2 * np.pi / sonar.wavelength,
        start=to_range * start, gate=to_range * (end - start) / gates, gates=gates, sound_speed=sonar.sound_speed,
        seed=seed)


def main_lobe(sonar: Sidescan, farthest: float) -> SpeckleBeam:
    """Return the two-way main lobe along the platform, down to -30 dB, up to a range [m]."""
    wavelength, length = sonar.wavelength, max(sonar.transmit.length, sonar.receive.length)
    nearest = max(NEAREST, NEAREST_LENGTHS * length)
    # beyond this range the beam no longer changes
    far = max(nearest, min(farthest, 8 * length ** 2 / wavelength))
    ranges = np.geomspace(nearest, far, 1 + int(np.ceil(PER_OCTAVE * np.log2(far / nearest))))
    widest, step = WIDEST, WIDEST / NODES
    if length:
        widest, step = min(2 * wavelength / length + length / nearest, WIDEST), STEP * wavelength / length
    u = np.linspace(0, widest, NODES + int(widest / step))
    pressure = near_pressure(sonar.transmit, u, ranges, wavelength)
    pressure = pressure * (pressure if sonar.one_face else near_pressure(sonar.receive, u, ranges, wavelength))
    pressure /= np.abs(pressure).max(1, keepdims=True)
    edge, table = np.empty(len(ranges)), np.empty((len(ranges), NODES), complex)
    for number, lobe in enumerate(pressure):
        edge[number] = u[min(np.flatnonzero(np.abs(lobe) ** 2 > LOBE_END)[-1] + 1, len(u) - 1)]
        table[number] = np.interp(np.linspace(0, edge[number], NODES), u, lobe)
    return SpeckleBeam(ranges=ranges, edge=edge, pressure=table)


def _way(survey):
    """Return phase centres and axes of all pings, as quadratics through three moments of the record."""
    track, duration = survey.track, max(survey.window[1], 1e-6)
    times = track.time[:, None] + duration * TIMES
    position, attitude = survey.voyage.trajectory.pose(times, track.time[:, None])
    forward = rotation_matrix(*np.moveaxis(attitude, -1, 0))[..., 0]
    centre, axis = 0.5 * (position[:, :1] + position), 0.5 * (forward[:, :1] + forward)
    centre[..., 2] -= (track.position[:, 2] - _levelled(track.position, survey.depth_below))[:, None]
    fit = np.linalg.inv((duration * TIMES)[:, None] ** np.arange(3))
    course = np.arctan2(axis[:, 0, 1], axis[:, 0, 0])
    return SpeckleWay(centre=np.einsum("kt,ptx->pkx", fit, centre), axis=np.einsum("kt,ptx->pkx", fit, axis),
                      lattice=_lattices(course))


def _levelled(position: np.ndarray, depth_below: np.ndarray) -> np.ndarray:
    """Return heights above the bed (P,) [m], averaged along the track so that ripples do not move scatterers."""
    bed = position[:, 2] - depth_below
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T)))
    if along[-1] == 0:
        return position[:, 2] - bed.mean()
    total = np.append(0.0, np.cumsum(np.diff(along) * 0.5 * (bed[1:] + bed[:-1])))
    low, high = (np.clip(along + end, 0, along[-1]) for end in (-0.5 * LEVEL_OVER, 0.5 * LEVEL_OVER))
    # the integral is quadratic between pings, but linear interpolation is as exact as the bed is known
    return position[:, 2] - (np.interp(high, along, total) - np.interp(low, along, total)) / (high - low)


def _lattices(course: np.ndarray) -> np.ndarray:
    """Return the numbers (P,) of the lattices for pings of a course [rad], x to y: one for each straight stretch."""
    spacing = np.pi / LATTICES
    number, start = np.empty(len(course), int), 0
    while start < len(course):
        first, ahead = np.round(course[start] / spacing) * spacing, STRETCH
        while True:                            # the search goes no further than twice the length of a stretch
            away = np.angle(np.exp(1j * (course[start:start + ahead] - first)))
            strays = np.flatnonzero(np.abs(away) > ALONG * spacing)
            if strays.size or start + ahead >= len(course):
                break
            ahead *= 2
        stop = start + (int(strays[0]) if strays.size else len(away))
        number[start:stop] = int(np.round((first + away[:stop - start].mean()) / spacing)) % LATTICES
        start = stop
    return number


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
    recorder: Recorder
    self_noise_db: float | None  # [dB re 1 µPa²/Hz]: of each side's receiver


def plan(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings) -> SidescanSurvey:
    """Plan a run over a scene."""
    geometry, passage, sonar = _laid(scene, sensor)
    window, bins = sensor.film().window(sonar.sound_speed)
    waters = planned_waters(sensor, geometry, passage, sonar.frequency)
    survey = SidescanSurvey(
        world=World(still=geometry), waters=waters, passage=passage, rays=settings.rays,
        max_depth=settings.max_depth, sonar=sonar, window=window, bins=bins, first_pass=settings.first_pass)
    limits.check_sidescan(survey)
    return survey


def plan_elements(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with each side's faces as elements, port and starboard.

    The pulse is a cw of the sidescan's effective length. Faces are even and flat, regardless of the sensor's shading,
    and receive nothing from behind their own planes; there is no recorder.
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
    record, sonar, track = energy.record(survey, Sides(survey), seed, progress), survey.sonar, survey.track
    head_depth = float(np.mean(-track.position[:, 2]))
    classes, class_of = classes_of(survey.labels)
    image = imaging.image(
        record, sonar=sonar, track=track, depth_below=survey.depth_below, window=survey.window, labels=survey.labels,
        class_of=class_of, paths=survey.paths.names, noise_db=noise_db(sensor, sonar),
        speckle=side_speckle(survey, seed).of if sensor.speckle else None, seed=seed,
        absorption_db=float(survey.waters.first.absorption.at(head_depth)), recorder=sensor.recorder)
    return objects.annotated(image, classes, class_of, survey.world.still, survey.track.position)


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
