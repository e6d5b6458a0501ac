"""Sidescan sonar: its run over a scene, its picture, and its faces as elements.

The speckle of a sidescan's pings: gates, main lobe and way that `echoes.ground_speckle` works with.
"""
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
from mitsonar.scene import materials, objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
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
from ..fan import kind as array
from ..pressure.array_survey import ArraySurvey
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed
from ..voyage import Passage

WIDEST = 0.2                       # cosine beyond which no lobe is followed: pings are no nearer than such beams tell
LOBE_END = 1e-3                    # two-way intensity at which the main lobe ends (-30 dB)
STEP = 1 / 32                      # of cosines, in wavelengths over the face's length
NODES = 64                         # of a lobe's table
PER_OCTAVE = 6.0                   # ranges that the beam is tabulated at
NEAREST, NEAREST_LENGTHS = 0.5, 0.5      # [m], and in lengths of the face: where its beam is looked at first
LEVEL_OVER = 20.0                  # [m] of the track over which the bed's depth is averaged
ALONG = 0.75                       # of the lattices' spacing: a course that strays further takes another lattice
STRETCH = 64                       # pings that the end of a stretch is first looked for in
TIMES = np.array([0.0, 0.5, 1.0])


def side_speckle(survey: SidescanSurvey, seed: int) -> GroundSpeckle:
    """Make the source of a survey's speckle."""
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
    # beyond, all ranges are alike
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
    """Height above the bed (P,) [m], with the bed's depth averaged along the track: ripples do not move scatterers."""
    bed = position[:, 2] - depth_below
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(position[:, :2], axis=0).T)))
    if way[-1] == 0:
        return position[:, 2] - bed.mean()
    total = np.append(0.0, np.cumsum(np.diff(way) * 0.5 * (bed[1:] + bed[:-1])))
    ends = [np.clip(way + end, 0, way[-1]) for end in (-0.5 * LEVEL_OVER, 0.5 * LEVEL_OVER)]
    # the integral is quadratic between pings, but the bed is not better known than so
    mean = (np.interp(ends[1], way, total) - np.interp(ends[0], way, total)) / (ends[1] - ends[0])
    return position[:, 2] - mean


def _lattices(course: np.ndarray) -> np.ndarray:
    """Numbers (P,) of the lattices that pings of a course [rad], from x to y, take: one for each straight stretch."""
    spacing = np.pi / LATTICES
    number, start = np.empty(len(course), int), 0
    while start < len(course):
        first, ahead = np.round(course[start] / spacing) * spacing, STRETCH
        while True:                            # a stretch is looked for no further than twice its length
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
    """Define the sensor of a sidescan.

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


def plan(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings) -> SidescanSurvey:
    """Plan a run over a scene."""
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


def plan_elements(scene: mi.Scene, sensor: SidescanSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with each side's faces as elements, port and starboard.

    The pulse is a cw of the sidescan's effective length. Faces are even and flat, whatever the sensor's are, and hear
    nothing from behind their own planes; `survey.signals` knows no recorder.
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
    """Return levels (ping, side, range) as rows of one picture: port mirrored, then starboard."""
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
    """Return noise of a receiver [dB re 1 µPa²/Hz], less what compression of the pulse gains."""
    if sensor.self_noise_db is None:
        return None
    return float(sensor.self_noise_db - _compression_db(sensor))


def _compression_db(sensor: SidescanSensor) -> float:
    """Return gain of compression over noise [dB]: how much longer the pulse is when it is sent."""
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
