"""Measurement of a ping and terms of the sonar equation, shared by all instruments that make soundings."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.hydrography.detection.bottom_backscatter import mean_absorption, transmission_loss_db
from mitsonar.hydrography.reduction.reduction import Located
from mitsonar.sonar.arrays.array import Array
from mitsonar.units import db_from_power
from mitsonar.water.column import AbsorptionColumn

from .survey import SoundedSurvey

FAINTEST = 1e-3                    # least pressure of a face's pattern: limits the correction of strengths


@dataclass(frozen=True, kw_only=True, eq=False)
class PingMeasurement:
    """Measurement of a ping: arrays (B,) over its beams, or over the bins of both sides."""

    valid: np.ndarray
    sector: np.ndarray  # number of the transmission
    travel_time: np.ndarray  # [s], since the transmission
    intensity: np.ndarray  # [µPa²], mean of the received echo


def absorption_to_bed(survey: SoundedSurvey, absorption: AbsorptionColumn) -> float:
    """Return the mean absorption [dB/m] from the sonar down to the lowest bed."""
    top = survey.planned_depth
    return float(mean_absorption(absorption, top, max(survey.world.depth_range[1], top + 1)))


def two_way_loss_db(places: Located, absorption: AbsorptionColumn, bed_speed: np.ndarray,
                    head_speed: float) -> np.ndarray:
    """Return the two-way transmission loss [dB]; sound speeds [m/s] are those at the bed and at the head."""
    return 2 * (transmission_loss_db(places, absorption) - db_from_power(bed_speed / head_speed))


def face_pattern_db(array: Array, towards: np.ndarray, wavelength: float) -> np.ndarray:
    """Return the pattern [dB] of an array's face towards directions (B, 3), 0 on its axis."""
    pressure = array.element_pressure(towards, wavelength, array.normal[0], array.along[0])
    return 2 * db_from_power(np.maximum(np.abs(pressure), FAINTEST))
