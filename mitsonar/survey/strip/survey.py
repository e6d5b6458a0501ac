"""What a run of a synthetic aperture is. Data only."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_survey import ArraySurvey

__all__ = ["StripSurvey"]


@dataclass(frozen=True, kw_only=True)
class StripSurvey(ArraySurvey):
    """A run of a synthetic aperture.

    Attributes
    ----------
    bank : (rx,) int
        Number of the row that each receiver is in.
    look : (3,) [-]
        Unit vector that the elements look along, body frame.
    bed_depth : float [m]
        Mean depth of the bed that the record sees.
    grid : {"ground", "slant"}
        Of the picture.
    grid_spacing : float or None [m]
        Between its points; None: half the resolution.
    aperture_window, range_window : str
        Over the aperture's angles and over the pulse's band, of the picture.
    preset : str
    """

    bank: np.ndarray
    look: np.ndarray
    bed_depth: float
    grid: str
    grid_spacing: float | None
    aperture_window: str
    range_window: str
    preset: str
