"""Sonar with arrays: its run over a scene, and the picture that its beams make."""
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.scene import materials
from mitsonar.scene.geometry import Geometry
from mitsonar.signal.noise import ElementNoise
from mitsonar.signal.reception import least_rate, occupied_band
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.beam_patterns import element_directivity_index_db
from mitsonar.sonar.pulses.pulses import Pulse

from ..beam_domain.fan_pictures import FanPictures
from ..pressure.array_survey import ArraySurvey
from ..pressure.signals import LEAD
from ..pressure.sources import RaySources
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed
from ..voyage import Passage

CELL_SHARE = 0.02                  # of the altitude that a cell spans at most, where the scene does not say
MOST_PULSE_SAMPLES = 100_000       # 2 s of 20 kHz; a spectrum takes seconds by then


class ArraySensor(Sensor, Protocol):
    """Define the sensor of a sonar with arrays.

    Attributes
    ----------
    source_level_db : float [dB re 1 µPa @ 1 m]
        Of the whole transmit array, towards where it is steered.
    pulse : Pulse
    transmit, receive : Array
        Delays of steering are made for `nominal_sound_speed`.
    nominal_sound_speed : float [m/s]
    steering_delays : ((T,), (E,)) [s]
        Delays of both arrays as they were made: those that follow the sound speed.
    delays_from_file : (bool, bool)
        Of transmit and receive array: their delays are times of a file, not lengths over a sound speed.
    beams : int
        Of the picture's fan,
    fan_width : float [rad]
        and how wide that is.
    self_noise_db : float or None [dB re 1 µPa²/Hz]
        Of each receiver.
    picture : {"beams", "elements"} or None
        How the picture is made; None: in the beam domain where that can be done.
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
    """Plan a run whose record is to become a picture: it begins a pulse early; see `plan_elements`."""
    return plan_elements(scene, sensor, settings, LEAD)


def plan_elements(scene: "mi.Scene", sensor: ArraySensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan a run over a scene."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
    speed = head_speed(sensor, passage.depth)
    # a file's own delays are times, and what delays were changed by since; those of steering are lengths over a speed
    transmit, receive = (
        array if from_file else replace(
            array, delay=steering * (sensor.nominal_sound_speed / speed) + (array.delay - steering))
        for array, steering, from_file in zip((sensor.transmit, sensor.receive), sensor.steering_delays,
                                              sensor.delays_from_file))
    return survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=speed, transmit=transmit,
                     receive=receive, pulse=sensor.pulse, source_level_db=sensor.source_level_db,
                     bins_are_samples=True, self_noise_db=sensor.self_noise_db)


def survey_of(geometry: Geometry, sensor: Sensor, settings: RunSettings, passage: Passage, *, lead: float,
              sound_speed: float, transmit: Array, receive: Array, pulse: Pulse, source_level_db: float,
              bins_are_samples: bool, self_noise_db: float | None, whole_bins: bool = False,
              usual_rate: float | None = None) -> ArraySurvey:
    """Make the survey of arrays whose route is laid."""
    # sound_speed [m/s]; source_level_db [dB re 1 µPa @ 1 m]; self_noise_db [dB re 1 µPa²/Hz]; usual_rate [Hz]
    water = sensor.water
    materials.check(geometry, water.profile, pulse.frequency)
    # echoes from ahead and astern lie 2 v f / c up and down; two thirds of the sampled band are flat
    doppler = 2 * float(np.linalg.norm(passage.voyage.velocity, axis=1).max()) * pulse.frequency / sound_speed
    start, rate, samples = sensor.film().sampling(
        sound_speed, (usual_rate or pulse.suggested_sampling_rate) + 3 * doppler, written=bins_are_samples)
    if bins_are_samples and lead:                          # impulses have no pulse, and take any rate
        _check_rate(sensor, pulse, rate, least_rate(pulse, 1 + doppler / pulse.frequency), sound_speed)
    if whole_bins:
        window, bins = sensor.film().window(sound_speed)
        samples = bins * max(int(np.ceil(rate * (window[1] - window[0]) / bins - 1e-9)), 1)
        rate = samples / (window[1] - window[0])
        start = window[0] + 0.5 / rate
    if pulse.duration * rate > MOST_PULSE_SAMPLES:
        raise ValueError(f"{rate / 1000:.3g} kHz make {pulse.duration * rate:.3g} samples of the pulse's "
                         f"{1000 * pulse.duration:g} ms, and {MOST_PULSE_SAMPLES} are the most; take fewer bins, a "
                         "longer range or a shorter pulse")
    extra = int(np.ceil(lead * pulse.duration * rate))
    mean_depth = -float(passage.voyage.track.position[:, 2].mean())
    return ArraySurvey(
        geometry=geometry, profile=water.profile, absorption=water.absorption_column(pulse.frequency),
        volume=water.volume, passage=passage, rays=settings.rays, max_depth=settings.max_depth, pulse=pulse,
        source_level_db=source_level_db, transmit=transmit, receive=receive, start=start - extra / rate,
        sampling_rate=rate, samples=samples + extra, lead=extra, ensonification=settings.ensonification,
        cell_size=settings.cell_size or _cell_size(sound_speed, pulse, passage),
        per_cell=settings.scatterers_per_cell, pass_number=sensor.pass_number,
        sources=_ray_sources(settings, transmit),
        noise=_element_noise(sensor, receive, sound_speed / pulse.frequency, rate, self_noise_db),
        absorption_db=water.mean_absorption(mean_depth, geometry.depth_range[1]))


def _check_rate(sensor: Sensor, pulse: Pulse, rate: float, needed: float, sound_speed: float) -> None:
    """Refuse bins, or a sampling rate, of the film that are too few for the pulse, by attribute, file and line."""
    if rate >= needed * (1 - 1e-9):
        return
    name, value = sensor.film().written
    (start, end), _ = sensor.film().window(sound_speed)
    made = "" if name == "sample_rate_khz" else (
        f", which sample {0.5 * sound_speed * (end - start):.4g} m of range at {rate / 1000:.4g} kHz")
    enough = needed / 1000 if name == "sample_rate_khz" else np.ceil(needed * (end - start))
    raise ValueError(f"{sensor.place_of('film', name)}{name} is {value:g}{made}, and the pulse of this {sensor.kind} "
                     f"has a band of {occupied_band(pulse) / 1000:.4g} kHz. Remove {name}, so that the pulse sets the "
                     f"rate, or give at least {enough:.6g}")


def picture(survey: ArraySurvey, sensor: ArraySensor, seed: int, progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the array's beams, with its truth; see `mitsonar.render`."""
    return _pictures(survey, sensor, seed).whole(progress, say)


def frames(survey: ArraySurvey, sensor: ArraySensor, seed: int) -> Iterator[xr.Dataset]:
    """Yield the pictures of pings one by one; see `mitsonar.frames`."""
    return _pictures(survey, sensor, seed).one_by_one()


def _pictures(survey: ArraySurvey, sensor: ArraySensor, seed: int) -> FanPictures:
    return FanPictures(survey, directions(survey, sensor), seed=seed, way=sensor.picture)


def directions(survey: ArraySurvey, sensor: ArraySensor) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (B,) [rad] and directions (B, 3) of the picture's beams, body frame."""
    return fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, beam, sample) as rows of one picture, ping after ping."""
    return level.reshape(-1, level.shape[-1])


def _cell_size(sound_speed: float, pulse: Pulse, passage: Passage) -> float:
    """Return half the range resolution, but no more than beams resolve across: a fraction of the altitude."""
    altitude = max(float(np.mean(passage.depth_below)), 1.0)
    return min(sound_speed / (4 * pulse.bandwidth), altitude * CELL_SHARE)


def _ray_sources(settings: RunSettings, transmit: Array) -> RaySources:
    """Return the sources of rays, with the share of each element that they stand for."""
    if settings.ray_sources == "elements":
        return RaySources.from_elements(transmit)
    if settings.ray_sources == "interpolated":
        return RaySources.interpolated(transmit, settings.ray_source_count)
    return RaySources.from_centre(transmit)


def _element_noise(sensor: Sensor, receive: Array, wavelength: float, sampling_rate: float,
                   self_noise_db: float | None) -> ElementNoise | None:
    """Noise of the sea, less what the elements' own beams keep out, and of the receivers; None where there is none."""
    if not sensor.noise and self_noise_db is None:
        return None
    ambient_db = None
    if sensor.noise:
        ambient_db = sensor.noise_level_db() - element_directivity_index_db(receive, wavelength)
    return ElementNoise(position=receive.position, wavelength=wavelength, sampling_rate=sampling_rate,
                        ambient_db=ambient_db, self_noise_db=self_noise_db)
