"""Plan the survey of a sonar with arrays: sampling of the record, scatterer cells, ray sources and noise."""
from __future__ import annotations

import numpy as np

from mitsonar.scene.geometry import Geometry
from mitsonar.scene.world import World
from mitsonar.signal.noise import ElementNoise
from mitsonar.signal.reception import least_rate, occupied_band
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.beam_patterns import element_directivity_index_db
from mitsonar.sonar.pulses.pulses import Pulse

from ..sensor import RunSettings, Sensor, planned_waters
from ..voyage import Passage
from .array_survey import ArraySurvey
from .sources import RaySources

CELL_SHARE = 0.02                  # largest cell size, as a share of the altitude, where the scene gives no cell size
MOST_PULSE_SAMPLES = 100_000       # 2 s at 20 kHz; the spectrum of such a pulse already takes seconds


def survey_of(geometry: Geometry, sensor: Sensor, settings: RunSettings, passage: Passage, *, lead: float,
              sound_speed: float, transmit: Array, receive: Array, pulse: Pulse, source_level_db: float,
              bins_are_samples: bool, self_noise_db: float | None, whole_bins: bool = False,
              usual_rate: float | None = None) -> ArraySurvey:
    """Return the survey of arrays along a planned route; its record begins `lead` pulse lengths early.

    With `whole_bins` the sampling rate is such that every bin has the same number of samples.
    """
    # sound_speed [m/s]; source_level_db [dB re 1 µPa @ 1 m]; self_noise_db [dB re 1 µPa²/Hz]; usual_rate [Hz]
    film, waters = sensor.film(), planned_waters(sensor, geometry, passage, pulse.frequency)
    # Doppler shifts echoes from ahead and astern by 2 v f / c; the filter is flat over two thirds of the sampled band.
    doppler = 2 * float(np.linalg.norm(passage.voyage.velocity, axis=1).max()) * pulse.frequency / sound_speed
    start, rate, samples = film.sampling(
        sound_speed, (usual_rate or pulse.suggested_sampling_rate) + 3 * doppler, written=bins_are_samples)
    if bins_are_samples and lead:                          # impulse responses have no pulse, so any rate will do
        _check_rate(sensor, pulse, rate, least_rate(pulse, 1 + doppler / pulse.frequency), sound_speed)
    if whole_bins:
        window, bins = film.window(sound_speed)
        samples = bins * max(int(np.ceil(rate * (window[1] - window[0]) / bins - 1e-9)), 1)
        rate = samples / (window[1] - window[0])
        start = window[0] + 0.5 / rate
    if pulse.duration * rate > MOST_PULSE_SAMPLES:
        raise ValueError(f"at {rate / 1000:.3g} kHz the pulse of {1000 * pulse.duration:g} ms has "
                         f"{pulse.duration * rate:.3g} samples, and {MOST_PULSE_SAMPLES} are the most; take fewer "
                         "bins, a longer range or a shorter pulse")
    extra = int(np.ceil(lead * pulse.duration * rate))
    return ArraySurvey(
        world=World.of(geometry, settings.seed, passage.voyage.track, waters), waters=waters, passage=passage,
        rays=settings.rays, max_depth=settings.max_depth, pulse=pulse, source_level_db=source_level_db,
        transmit=transmit, receive=receive,
        start=start - extra / rate, sampling_rate=rate, samples=samples + extra, lead=extra,
        ensonification=settings.ensonification,
        cell_size=settings.cell_size or _cell_size(sound_speed, pulse, passage),
        per_cell=settings.scatterers_per_cell, pass_number=sensor.pass_number,
        sources=_ray_sources(settings, transmit),
        noise=_element_noise(sensor, receive, sound_speed / pulse.frequency, rate, self_noise_db))


def _check_rate(sensor: Sensor, pulse: Pulse, rate: float, needed: float, sound_speed: float) -> None:
    """Raise `ValueError` if the film's bins or sampling rate are too few for the pulse."""
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


def _cell_size(sound_speed: float, pulse: Pulse, passage: Passage) -> float:
    """Return half the range resolution [m], limited to the share of the altitude that beams resolve across."""
    altitude = max(float(np.mean(passage.depth_below)), 1.0)
    return min(sound_speed / (4 * pulse.bandwidth), altitude * CELL_SHARE)


def _ray_sources(settings: RunSettings, transmit: Array) -> RaySources:
    if settings.ray_sources == "elements":
        return RaySources.from_elements(transmit)
    if settings.ray_sources == "interpolated":
        return RaySources.interpolated(transmit, settings.ray_source_count)
    return RaySources.from_centre(transmit)


def _element_noise(sensor: Sensor, receive: Array, wavelength: float, sampling_rate: float,
                   self_noise_db: float | None) -> ElementNoise | None:
    """Return ambient noise, less the elements' directivity, and receiver noise; None if there is neither."""
    if not sensor.noise and self_noise_db is None:
        return None
    ambient_db = None
    if sensor.noise:
        ambient_db = sensor.noise_level_db() - element_directivity_index_db(receive, wavelength)
    return ElementNoise(position=receive.position, wavelength=wavelength, sampling_rate=sampling_rate,
                        ambient_db=ambient_db, self_noise_db=self_noise_db)
