"""What of a sonar's picture gradients can be of: its rows, and the linear way from their energies to intensities.

    I = P L E,    dI = P L dE,    Eᵀ = Lᵀ Pᵀ Iᵀ

P -> what the pulse makes of neighbouring bins; L -> what the sides of a sidescan hear of each other. Both are
symmetric.
"""
from __future__ import annotations

from typing import Any, Protocol

import mitsuba as mi
import numpy as np

from ..imaging.recorder import leaked
from ..imaging.sidescan import mean_intensity, pulse_shares
from ..survey import energy
from ..survey.rows import Rows
from ..survey.sides import Sides
from ..survey.sidescan import noise_db
from ..survey.sidescan_survey import SidescanSurvey
from ..survey.survey import Survey
from ..units import power_from_db

__all__ = ["Picture", "SidescanPicture", "picture_of"]


class Picture(Protocol):
    """A sonar's picture.

    Attributes
    ----------
    survey : Survey
    sensor : mitsuba.Sensor
    rows : Rows
    """

    survey: Survey
    sensor: Any
    rows: Rows

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Give what the picture shows of energies (ping, row, bin) [µPa²]."""
        ...

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Give the transpose of `shown`, of weights (ping, row, bin)."""
        ...

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Give what stands still (N,) [µPa²]: noise, and echoes other than those of first hits."""
        ...


class SidescanPicture:
    """The picture of a sidescan; see `Picture`.

    Parameters
    ----------
    survey : SidescanSurvey
    sensor : mitsuba.Sensor
    """

    def __init__(self, survey: SidescanSurvey, sensor: Any):
        self.survey: Survey = survey
        self.sensor, self.rows = sensor, Sides(survey)
        self._shares = pulse_shares(survey.bin_length, survey.sonar.pulse_length)
        noise = noise_db(sensor, survey.sonar)
        self._noise = 0.0 if noise is None else float(power_from_db(noise))

    def shown(self, energy: np.ndarray) -> np.ndarray:
        """Give what the picture shows of energies."""
        return leaked(mean_intensity(energy, self._shares), self.sensor.recorder)

    def transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Give the transpose of `shown`: pulse and leakage are symmetric."""
        return mean_intensity(leaked(cotangent, self.sensor.recorder), self._shares)

    def still(self, survey: Survey, seed: int) -> np.ndarray:
        """Give noise, and echoes other than those of first hits."""
        total = np.full((survey.track.pings, 2, self.rows.bins.count), self._noise)
        if len(self.rows.paths) > 1 or has_phases(survey):
            record = energy.record(survey, self.rows, seed)
            if record.path_intensity is not None:
                others = record.path_intensity[:, :, 1:].astype(float).sum(2)
                total += self.shown(others)
            if record.coherent is not None:
                total += leaked(record.coherent.intensity.astype(float), self.sensor.recorder)
        return total.ravel()


def has_phases(survey: Survey) -> bool:
    """Whether anything in a scene has an echo of a phase of its own."""
    geometry = survey.geometry
    smooth = any(getattr(shape.bsdf(), "smooth", False) for shape in geometry.scene.shapes())
    return bool(geometry.targets()) or smooth or geometry.surface_mirrors


def picture_of(scene: mi.Scene, sensor: Any, integrator: Any) -> Picture:
    """Plan what gradients can be of.

    Raises
    ------
    ValueError
        If they cannot be of this kind of sonar, or scene and sonar do not fit together.
    """
    survey = integrator.survey(scene, sensor)
    if sensor.kind == "sidescan":
        return SidescanPicture(survey, sensor)
    raise ValueError(f"gradients are of sidescans, and this sensor is a {sensor.kind}")
