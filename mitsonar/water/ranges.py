"""What the formulas of this folder may be asked: wider than any sea, narrow enough to catch a swapped column."""
import numpy as np

# name -> (lowest, highest, unit). Depths begin above the still surface, where wave crests are.
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


def checked(formula, **values):
    """Give the values as float64 arrays, in order, or raise a ValueError naming the first outside `RANGES`."""
    arrays = []
    for name, value in values.items():
        low, high, unit = RANGES[name]
        array = np.asarray(value, float)
        bad = ~((array >= low) & (array <= high))  # a NaN is bad too
        if bad.any():
            got, limits = f"{array[bad].flat[0]:g} {unit}".strip(), f"{low:g}..{high:g} {unit}".strip()
            raise ValueError(f"{formula}: {name} is {got}; it must lie in {limits}.")
        arrays.append(array)
    return arrays
