"""Map energies of a sonar's rows to the intensities of its picture, linearly.

    I = P L E,    dI = P L dE,    Eᵀ = Lᵀ Pᵀ Iᵀ

P -> smearing by the pulse over neighbouring bins; L -> leakage between the sides of a sidescan. Both are symmetric.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import mitsuba as mi
import numpy as np

from mitsonar.imaging.leakage import leaked
from mitsonar.imaging.sidescan import mean_intensity
from mitsonar.scene.protocols import is_smooth
from mitsonar.signal.gates import pulse_shares
from mitsonar.survey.energy import energy
from mitsonar.survey.energy.rows import Rows
from mitsonar.survey.energy.sides import Sides
from mitsonar.survey.energy.sidescan_survey import SidescanSurvey
from mitsonar.survey.fan import forward_looking, kind as array
from mitsonar.survey.fan.beams import Beams
from mitsonar.survey.integrator import SoundIntegrator
from mitsonar.survey.pressure.array_survey import ArraySurvey
from mitsonar.survey.sector_scan import kind as sector_scan
from mitsonar.survey.sensor import Sensor, Water
from mitsonar.survey.sidescan.kind import SidescanSensor, noise_db
from mitsonar.survey.survey import Survey
from mitsonar.units import power_from_db


class MovingWater(Water, Protocol):
    """Water with gradients by its sound speed and absorption."""

    speeds: mi.Float64  # (K,) [m/s]: sound speed at the nodes of the profile
    absorption_scale: mi.Float64  # (1,) [-]
    absorption_offset: mi.Float64  # (K,) [dB/m], at these nodes


class MovingSensor(Sensor, Protocol):
    """Sensor with gradients by its track and its water."""

    rows: int  # number of offsets of each kind
    position_offset: mi.Float64  # (3 rows,) [m]
    attitude_offset: mi.Float64  # (3 rows,) [rad]

    @property
    def water(self) -> MovingWater:
        """Return the water around the sonar."""
        ...


class MovingSidescan(SidescanSensor, MovingSensor, Protocol):
    """Sidescan sensor with gradients."""


class MovingArray(array.ArraySensor, MovingSensor, Protocol):
    """Sensor of arrays with gradients."""


class MovingForwardLooking(forward_looking.ForwardLookingSensor, MovingSensor, Protocol):
    """Sensor of a forward-looking sonar with gradients."""


class MovingScanner(sector_scan.SectorScanSensor, MovingSensor, Protocol):
    """Sensor of a rotating head with gradients."""


class Picture(Protocol):
    """Differentiable part of a sonar image: its rows, and the linear map from energies to intensities.

    Attributes
    ----------
    survey : Survey
    sensor : mitsuba.Sensor
    rows : Rows
    noise : float [µPa²]
        Noise in every bin, included in `still`.
    """

    survey: Survey
    sensor: MovingSensor
    rows: Rows
    noise: float

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Return the picture of energies (ping, row, bin) [µPa²]."""
        ...

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown` for weights (ping, row, bin)."""
        ...

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Return the constant part (N,) [µPa²]: noise, and echoes other than those of first hits."""
        ...


class SidescanPicture:
    """Map energies to the picture of a sidescan; see `Picture`."""

    def __init__(self, survey: SidescanSurvey, sensor: MovingSidescan):
        self.survey: Survey = survey
        self.sensor: MovingSensor = sensor
        self._leakage = sensor.leakage
        self.rows: Rows = Sides(survey, shadows=False)       # of few rays, those in lit bins count
        self._shares = pulse_shares(survey.bin_length, survey.sonar.pulse_length)
        noise = noise_db(sensor, survey.sonar)
        self.noise = 0.0 if noise is None else float(power_from_db(noise))

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Return the picture of energies."""
        return leaked(mean_intensity(energy, self._shares), self._leakage)

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`: pulse and leakage are symmetric."""
        return mean_intensity(leaked(cotangent, self._leakage), self._shares)

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Return noise, and echoes other than those of first hits."""
        total = np.full((survey.track.pings, 2, self.rows.bins.count), self.noise)
        if len(self.rows.paths) > 1 or has_phases(survey):
            record = energy.record(survey, self.rows, seed)
            if record.path_intensity is not None:
                others = record.path_intensity[:, :, 1:].astype(float).sum(2)
                total += self.shown(others)
            if record.coherent is not None:
                total += leaked(record.coherent.intensity.astype(float), self._leakage)
        return total.ravel()


class FanPicture:
    """Map energies to the mean intensities of a fan of beams, without noise; see `Picture`.

        <|y|²> = Σ_r E_r |R(t - t_r)|²,    R the compressed pulse, 1 at its peak

    A bin's mean is therefore the mixture of the beams, smeared over range, times Σ_k |R(k / f_s)|².
    """
    # directions (B,) [rad]

    def __init__(self, survey: ArraySurvey, sensor: MovingSensor, directions: tuple[np.ndarray, np.ndarray]):
        self.survey: Survey = survey
        self.sensor: MovingSensor = sensor
        self._beams = Beams(survey, *directions)
        self.rows: Rows = self._beams
        self.noise = 0.0
        self._gain = _compressed_energy(survey)

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Return the picture of energies."""
        return self._gain * np.moveaxis(self._beams.shown(np.moveaxis(energy, 0, 1)), 0, 1)

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`."""
        return self._gain * np.moveaxis(self._beams.shown_transposed(np.moveaxis(cotangent, 0, 1)), 0, 1)

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Return echoes with a phase of their own."""
        return _with_phase(survey, self.rows, seed)


def _compressed_energy(survey: ArraySurvey) -> float:
    """Return the energy of the compressed pulse [samples], relative to its peak."""
    length = 2 ** int(np.ceil(np.log2(4 * survey.pulse.duration * survey.sampling_rate + 64)))
    sent = survey.pulse.spectrum(survey.sampling_rate, length)
    compressed = np.abs(np.fft.ifft(np.abs(sent) ** 2)) ** 2
    return float(compressed.sum() / compressed.max())


class StepPicture:
    """Map energies to the mean intensities of a sector scan, without noise; see `Picture`."""

    def __init__(self, survey: ArraySurvey, sensor: MovingScanner):
        self.survey: Survey = survey
        self.sensor: MovingSensor = sensor
        self._steps = sector_scan.steps_of(survey, sensor)
        self.rows: Rows = self._steps
        self.noise = 0.0

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Return the picture of energies."""
        return self._steps.shown(energy)

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`: the pulse is symmetric."""
        return self._steps.shown(cotangent)

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Return echoes with a phase of their own."""
        return _with_phase(survey, self.rows, seed)


def _with_phase(survey: Survey, rows: Rows, seed: int) -> np.ndarray:
    """Return intensities (N,) [µPa²] of echoes with a phase of their own, as shown in pictures."""
    shape = survey.track.pings, rows.per_ping, rows.bins.count
    coherent = energy.record(survey, rows, seed).coherent if has_phases(survey) else None
    return np.zeros(int(np.prod(shape))) if coherent is None else coherent.intensity.astype(float).ravel()


def has_phases(survey: Survey) -> bool:
    """Return True if any echo of a scene has a phase of its own."""
    geometry = survey.world.only
    smooth = any(map(is_smooth, geometry.scene.shapes()))
    return bool(geometry.targets()) or smooth or geometry.surface_mirrors


def picture_of(scene: mi.Scene, sensor: Sensor, integrator: SoundIntegrator, rays: int | None = None) -> Picture:
    """Return the differentiable picture of a sensor, with at most `rays` rays per ping; its levels have no speckle."""
    if sensor.kind not in PICTURES:
        raise ValueError(f"gradients are of {', '.join(PICTURES)}, and this sensor is a {sensor.kind}; give the scene "
                         "one of them")
    survey = integrator.survey(scene, sensor)
    if rays is not None:
        survey = replace(survey, rays=min(survey.rays, rays))
    return PICTURES[sensor.kind](survey, sensor)


def _array(survey: ArraySurvey, sensor: MovingArray) -> Picture:
    return FanPicture(survey, sensor, array.directions(survey, sensor))


def _forward_looking(survey: ArraySurvey, sensor: MovingForwardLooking) -> Picture:
    return FanPicture(survey, sensor, forward_looking.directions(survey, sensor))


# each takes the survey and the sensor of its kind
PICTURES: dict[str, Callable[..., Picture]] = {
    "sidescan": SidescanPicture, "array": _array, "forward_looking": _forward_looking, "sector_scan": StepPicture}
