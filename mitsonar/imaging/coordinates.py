"""Shared parts of sonar images: coordinates of pings and bins, the floor of levels, and shadows.

    level = max(10 log10 p², NOTHING_DB)

A shadow begins after the first return. `shadow_by_bins` is for records that start in the water: a bin after the first
bottom return without a ray of the main lobe. `shadow_by_runs` is for truth from few scatterers: at least
`SHORTEST_SHADOW` bins without an echo, after the first bin with one.
"""
from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsonar.sonar.motion.track import Track
from mitsonar.units import NOTHING_DB, db_from_power

from .energy_record import EnergyRecord

SHORTEST_SHADOW = 3                # bins; shorter gaps without a ray are chance


def entry(dims: str | tuple[str, ...], values: object, units: str, long_name: str) -> tuple:
    """Return a variable in the form that xarray takes."""
    return dims, values, {"units": units, "long_name": long_name}


def levels(power: np.ndarray) -> np.ndarray:
    """Return the levels [dB re 1 µPa] of powers [µPa²], float32."""
    return np.maximum(db_from_power(power), NOTHING_DB).astype(np.float32)


def of_bins(labels: Mapping[int, str], slant_range: np.ndarray, time: np.ndarray) -> dict[str, tuple]:
    """Return the coordinates of shapes, and of bins by slant range [m] and two-way time [s]."""
    return {"shape": ("shape", list(labels.values()), {"long_name": "shapes in the order of their labels"}),
            "range": entry("range", slant_range, "m", "slant range at the head's sound speed"),
            "time": entry("range", time, "s", "two-way travel time")}


def of_pings(track: Track, depth_below: np.ndarray, whose: str = "") -> dict[str, tuple]:
    """Return the coordinates of pings: times, positions, attitudes (of `whose`), and heights above the seabed [m]."""
    place = zip("xyz", track.position.T, ("east", "north", "up, the sea surface is 0"))
    attitude = {"roll": "starboard down", "pitch": "nose up", "heading": "clockwise from north"}
    return {"ping_time": entry("ping", np.array(track.time), "s", "time of transmission"),
            **{axis: entry("ping", np.array(column), "m", words) for axis, column, words in place},
            **{name: entry("ping", np.array(getattr(track, name)), "rad", f"{name}{whose}, {words}")
               for name, words in attitude.items()},
            "altitude": entry("ping", np.array(depth_below, float), "m", "height above the seabed")}


def shadow_by_bins(record: EnergyRecord, below: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return labels and shadows (..., bins), uint32 and uint8; `below` is True from the first bottom return on."""
    in_beam = record.echoes_in_beam
    # within a shadow only side lobes contribute; such bins get no label
    label = np.where(in_beam > 0, record.truth.label, np.uint32(0))
    arrived = np.logical_or.accumulate((in_beam > 0) & below, -1)
    return label, (arrived & (in_beam == 0)).astype(np.uint8)


def shadow_by_runs(record: EnergyRecord) -> tuple[np.ndarray, np.ndarray]:
    """Return labels and shadows (..., bins), uint32 and uint8."""
    from scipy.ndimage import binary_opening

    rays, share = record.echoes_in_beam, record.truth.share
    empty = binary_opening(rays == 0, np.ones((1,) * (rays.ndim - 1) + (SHORTEST_SHADOW,), bool))
    shadow = (empty & np.logical_or.accumulate(rays > 0, -1)).astype(np.uint8)
    # bins that no ray reached by chance keep the label of the largest share
    return np.where(empty | ~share.any(-2), 0, share.argmax(-2) + 1).astype(np.uint32), shadow
