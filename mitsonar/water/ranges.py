"""Valid ranges of the formulas of seawater: wider than in any sea, yet narrow enough to detect swapped columns."""
from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

Formula = TypeVar("Formula")

# name -> (lowest, highest, unit). Depths begin above the still surface, to include wave crests.
RANGES = {
    "frequency": (0.0, 1e7, "Hz"),
    "temperature": (-2.0, 40.0, "deg C"),
    "salinity": (0.0, 45.0, "g/kg"),
    "depth": (-20.0, 12000.0, "m"),
    "ph": (7.0, 9.0, ""),
    "latitude": (-90.0, 90.0, "deg"),
    "longitude": (-360.0, 360.0, "deg"),
    "wind_speed": (0.0, 60.0, "m/s"),
    "shipping": (0.0, 1.0, ""),
}

# formula of sound speed -> narrower ranges of its fit. 1000 bar are 9727 m at the equator; the pressure of gsw begins
# 5 m above the still surface.
SOUND_SPEED_RANGES = {
    "teos-10": {"depth": (-5.0, 12000.0, "m")},
    "chen-millero": {"temperature": (0.0, 40.0, "deg C"), "salinity": (0.0, 40.0, "g/kg"),
                     "depth": (-5.0, 9727.0, "m")},
    "mackenzie": {"temperature": (-2.0, 30.0, "deg C"), "salinity": (30.0, 40.0, "g/kg"),
                  "depth": (-20.0, 8000.0, "m")},
    "medwin": {"temperature": (0.0, 35.0, "deg C"), "depth": (-20.0, 1000.0, "m")},
    "leroy-robinson-goldsmith": {"temperature": (-1.0, 30.0, "deg C"), "salinity": (0.0, 42.0, "g/kg")},
}


def checked(subject: str, ranges: Mapping[str, tuple[float, float, str]] = RANGES,
            **values: ArrayLike) -> list[np.ndarray]:
    """Return the values as float64 arrays, in order; `ValueError` with the first value outside ``ranges``."""
    arrays = []
    for name, value in values.items():
        low, high, unit = ranges[name]
        array = np.asarray(value, float)
        bad = ~((array >= low) & (array <= high))  # includes NaN
        if bad.any():
            got, limits = f"{array[bad].flat[0]:g} {unit}".strip(), f"{low:g}..{high:g} {unit}".strip()
            raise ValueError(f"{subject}: {name} is {got}; it must lie in {limits}.")
        arrays.append(array)
    return arrays


def chosen(subject: str, formula: str, formulas: Mapping[str, Formula]) -> Formula:
    """Return the formula of a name; `ValueError` with all names if it is unknown."""
    if formula not in formulas:
        raise ValueError(f"{subject}: formula {formula!r} is unknown; use one of {', '.join(formulas)}.")
    return formulas[formula]
