"""Levels of water columns by angle: before the first return, at its time, and of the bed in the same beam.

The first return of a ping is the bed's smallest travel time. Side lobes of beams that look aside receive it at the same
time, which is the ring of the first return. Ratios to the bed of the same beam need no calibration.
"""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.units import db_from_power, power_from_db

from .angle_bins import AngleBins

MOST_PINGS = 12
WATER = 0.5, 0.9                   # of the first return's time: water before it
RING = 0.99, 1.03
BED = 0.98, 1.02                   # of the bed's time in the beam
ASIDE = 1.08                       # bed over first return, beyond which a beam shows the ring
TERMS = ("column_water", "column_ring", "column_noise")
FEWEST = 3                         # beams of a bin


def column_terms(line: xr.Dataset, pings: np.ndarray, bins: AngleBins) -> dict[str, np.ndarray] | None:
    """Return the terms of the water column in bins; None without a column."""
    if "column_level_db" not in line:
        return None
    pings = np.unique(pings)
    pings = pings[np.unique(np.linspace(0, pings.size - 1, MOST_PINGS).astype(int))]
    found = [_of_ping(line.isel(ping=ping)) for ping in pings]
    angle = np.concatenate([one[0] for one in found])
    return {name: bins.over(angle, np.concatenate([one[1 + number] for one in found]), fewest=FEWEST)
            for number, name in enumerate(TERMS)}


def _of_ping(ping):
    """Return angles of a ping's column beams, and their three terms."""
    valid = ping["valid"].values
    angle, time = ping["angle"].values[valid], ping["travel_time"].values[valid]
    order = np.argsort(angle)
    beam = ping["column_angle"].values
    bed = np.interp(beam, angle[order], time[order], np.nan, np.nan)
    first = float(time.min())
    level = ping["column_level_db"].values
    start, rate = (ping[f"column_{name}"].values[:, None] for name in ("start", "rate"))
    when = start + np.arange(level.shape[1]) / rate
    power = power_from_db(level)
    at_bed = _mean_db(power, when, BED[0] * bed[:, None], BED[1] * bed[:, None])
    water = _mean_db(power, when, WATER[0] * first, WATER[1] * first)
    ring = np.where(bed > ASIDE * first, _mean_db(power, when, RING[0] * first, RING[1] * first), np.nan)
    inside = (when >= WATER[0] * first) & (when < WATER[1] * first) & np.isfinite(level)
    values = np.ma.array(level, mask=~inside)
    middle = np.ma.median(values, axis=1, keepdims=True)
    noise = 1.4826 * np.ma.median(np.abs(values - middle), axis=1).filled(np.nan)
    # the vertical: the beam's angle, less the roll of the array
    tilt = float(ping["ping_roll"]) + float(ping["receive_mounting"][0])
    return beam - tilt, water - at_bed, ring - at_bed, noise


def _mean_db(power, when, low, high):
    """Return the level of the mean power of each beam between two times."""
    inside = (when >= low) & (when < high) & np.isfinite(power)
    count = inside.sum(1)
    mean = np.where(inside, power, 0.0).sum(1) / np.maximum(count, 1)
    return np.where((count > 0) & (mean > 0), db_from_power(np.maximum(mean, 1e-300)), np.nan)
