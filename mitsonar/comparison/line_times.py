"""Times of two lines: along rays to the real places, and as both detectors found them.

    residual = (t_T + t_R - travel_time) c / 2,        less the part that three lever arms a ping explain

t_T, t_R -> times along rays from the transmit array to the real sounding and back, once in the real line's own water
and once in the simulated line's. Detected times are compared at the same places; there the three arms of a ping are
those of the unit vectors from the arrays to its soundings.
"""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.hydrography.reduction.resounding import heads_of
from mitsonar.hydrography.vertical_angles import vertical_angle
from mitsonar.planning.instrument_rules import rules_of, time_residuals, under_record

from .matching import PairedPings

MOST_PINGS = 24                    # whose rays are traced
FEWEST = 8                         # soundings of a ping whose arms are fitted
LEAST = 1e-2                       # of the largest singular value: directions that one ping hardly shows
OUTLIERS = 4.0                     # spreads


def ray_times(real: xr.Dataset, simulated: xr.Dataset, pairs: PairedPings
              ) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray], tuple[str, ...]]:
    """Return angles (N,) [rad], residuals (N,) [m] in both waters, bare and with arms fitted, and remarks."""
    pings = np.intersect1d(pairs.real, under_record(real))
    if not pings.size:
        return np.zeros(0), [], [], ("the real line's motion does not reach from a ping to its last echo, so that no "
                                     "rays were traced",)
    pings = np.unique(pings[np.linspace(0, pings.size - 1, MOST_PINGS).astype(int)])
    one, rules = real.isel(ping=pings), rules_of(real)
    angle, valid = vertical_angle(one), one["valid"].values
    angles = np.concatenate([angle[ping][valid[ping]] for _, group in heads_of(one) for ping in group])
    bare, fitted = [], []
    for line in (one, _in_water(one, simulated, pairs)):
        residuals = time_residuals(line, rules.node, rules.under_way)
        bare.append(np.concatenate([each for each, _ in residuals]))
        fitted.append(np.concatenate([each for _, each in residuals]))
    return angles, bare, fitted, rules.words


def _in_water(real, simulated, pairs):
    """Return the real line with the cast and the head's sound speed of the simulated one."""
    true = "true_cast_depth" in simulated
    cast = {f"cast_{name}": ("node", simulated[f"{'true_' * true}cast_{name}"].values)
            for name in ("depth", "sound_speed")}
    speed = float(np.median(simulated["head_sound_speed"].values[pairs.simulated]))
    return real.drop_dims("node").assign(cast).assign(
        head_sound_speed=("ping", np.full(real.sizes["ping"], speed)))


def echo_times(real: xr.Dataset, pairs: PairedPings, travel_time: np.ndarray) -> np.ndarray:
    """Return simulated less real times (P, beam) [m], one way, at the same places, after three lever arms a ping."""
    one = real.isel(ping=pairs.real)
    half = 0.5 * one["head_sound_speed"].values[:, None]
    apart = half * (travel_time - one["travel_time"].values)
    down = one["depth"].values - one["ping_depth"].values[:, None]
    way = np.stack([one["along_track"].values, one["across_track"].values, down], -1)
    way = way / np.linalg.norm(way, axis=-1, keepdims=True)
    return np.stack([_without_arms(row, axes) for row, axes in zip(apart, way)])


def _without_arms(apart, way):
    """Return differences (beam,) less those that lever arms explain; outliers do not take part in the fit."""
    known = np.isfinite(apart) & np.isfinite(way).all(-1)
    used = known.copy()
    left = np.full(apart.shape, np.nan)
    for _ in range(3):
        if used.sum() < FEWEST:
            return left
        arms = np.linalg.lstsq(way[used], apart[used], rcond=LEAST)[0]
        left = np.where(known, apart - way @ arms, np.nan)
        spread = 1.4826 * np.nanmedian(np.abs(left[used])) + 1e-9
        used = known & (np.abs(left) < OUTLIERS * spread)
    return left
