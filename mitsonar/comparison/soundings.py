"""Comparison of a real line of soundings with a simulated one of the same track."""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import BY_PHASE, as_written, check
from mitsonar.hydrography.vertical_angles import vertical_angle
from mitsonar.units import db_from_power, deg_from_radians, power_from_db

from .angle_bins import AngleBins, root_mean_square, spread
from .line_column import TERMS, column_terms
from .line_times import echo_times, ray_times
from .matching import PairedPings, at_soundings, paired
from .record import INNER, SOUNDINGS, LineComparison, comparison

OPTIONAL = ("quality", "uncertainty")
COMMON = 0.25                      # of the real pings sound an angle; of two heads with two swaths, every fourth does
SAME_BEAM = 0.5                    # distance of beams within which beams of several pings are neighbours


def compare_soundings(real: xr.Dataset, simulated: xr.Dataset, names: tuple[str, str]) -> LineComparison:
    """Return the comparison of two lines of one track; raise `ValueError` if they are not."""
    for line, name in zip((real, simulated), names):
        check(line, name)
    real, simulated = as_written(real), as_written(simulated)
    pairs = paired(real, simulated)
    kept = [_as_written(line.isel(ping=np.unique(pings))) for line, pings in (
        (real, pairs.real), (simulated, pairs.simulated))]
    angles = [np.where(line["valid"].values, vertical_angle(line), np.nan) for line in kept]
    bins = AngleBins.of(angles[0])
    remarks = [_pairs_words(pairs)]
    values = _times_and_depths(real, simulated, pairs, bins, remarks)
    values |= _strengths(kept, angles, bins) | _noise(kept, angles, bins) | _detections(kept, angles, bins, remarks)
    for name in OPTIONAL:
        if all(name in line and np.isfinite(line[name]).any() for line in kept):
            values[name] = np.stack([bins.over(angle, line[name].values) for line, angle in zip(kept, angles)])
    columns = [column_terms(line, pings, bins) for line, pings in (
        (real, pairs.real), (simulated, pairs.simulated))]
    both = [column for column in columns if column is not None]
    if len(both) == 2:
        values |= {name: np.stack([column[name] for column in both]) for name in TERMS}
    middle = xr.Variable("angle", bins.middle, {"units": "rad", "long_name": "from the vertical, to starboard"})
    return comparison(values, SOUNDINGS, {"line": ["real", "simulated"], "angle": middle},
                      {"of": "soundings", "real": names[0], "simulated": names[1], "pings": int(pairs.real.size),
                       "paired_by": pairs.by, "remarks": remarks})


def _as_written(line: xr.Dataset) -> xr.Dataset:
    """Return a line with the strengths that its instrument writes, where a simulated one has both kinds."""
    written = line.get("written_backscatter_db")
    return line if written is None else line.assign(backscatter_db=written)


def _pairs_words(pairs: PairedPings) -> str:
    """Return a remark on the paired pings."""
    apart = [words for value, words in ((pairs.seconds, f"{1e3 * pairs.seconds:.3g} ms"),
                                        (pairs.metres, f"{pairs.metres:.3g} m")) if np.isfinite(value)]
    return (f"{pairs.real.size} real pings were paired with {np.unique(pairs.simulated).size} simulated ones by "
            f"{pairs.by}, {' and '.join(apart)} apart in the middle of them"
            + (f"; {pairs.others} real pings at other frequencies were left out" if pairs.others else ""))


def _times_and_depths(real, simulated, pairs, bins, remarks):
    """Return the terms of paired pings at the same places."""
    angle, bare, fitted, words = ray_times(real, simulated, pairs)
    remarks += words
    values = {}
    if bare:
        values = {"ray_time_bare": [root_mean_square(one) for one in bare],
                  "ray_time": [root_mean_square(one) for one in fitted],
                  "ray_time_by_angle": np.stack([bins.over(angle, one, "mean") for one in fitted]),
                  "ray_time_rms_by_angle": np.stack([bins.over(angle, one, root_mean_square) for one in fitted])}
    depth, time = at_soundings(real, simulated, pairs)
    one = real.isel(ping=pairs.real)
    angle = np.where(one["valid"].values, vertical_angle(one), np.nan)
    echo = echo_times(real, pairs, time)
    apart = 100 * (depth - one["depth"].values) / one["depth"].values
    return values | {"echo_time_difference": bins.over(angle, echo), "echo_time_spread": bins.over(angle, echo, spread),
                     "depth_difference": bins.over(angle, apart), "depth_spread": bins.over(angle, apart, spread)}


def _strengths(lines, angles, bins):
    """Return the terms of strengths, if both lines have any."""
    if not all("backscatter_db" in line and np.isfinite(line["backscatter_db"]).any() for line in lines):
        return {}
    strength = np.stack([db_from_power(bins.over(angle, power_from_db(line["backscatter_db"].values), "mean"))
                         for line, angle in zip(lines, angles)])
    error = np.hypot(*(bins.over(angle, power_from_db(line["backscatter_db"].values), _relative_error)
                       for line, angle in zip(lines, angles))) * 10 / np.log(10)
    apart = strength[1] - strength[0]
    near = np.isfinite(apart) & (np.abs(deg_from_radians(bins.middle)) < INNER)
    shape = apart - np.median(apart[near]) if near.any() else np.full(apart.shape, np.nan)
    return {"strength": strength, "strength_difference": apart, "strength_shape": shape, "strength_error": error}


def _relative_error(power):
    """Return the standard error of the mean of independent values, over the mean."""
    return float(np.std(power) / np.mean(power) / np.sqrt(power.size)) if power.size else np.nan


def _noise(lines, angles, bins):
    """Return the spreads of differences between neighbours."""
    found = {"depth_noise_beams": [], "depth_noise_pings": [], "strength_noise": []}
    for line, angle in zip(lines, angles):
        valid = line["valid"].values
        depth = np.where(valid, line["depth"].values, np.nan)
        share = 100 * depth / np.nanmedian(depth)
        found["depth_noise_beams"].append(bins.over(angle[:, 1:-1], _second(share), spread))
        found["depth_noise_pings"].append(_from_ping_to_ping(line, angle, share, bins))
        level = line["backscatter_db"].values if "backscatter_db" in line else np.full(valid.shape, np.nan)
        found["strength_noise"].append(bins.over(angle[:, 1:-1], _second(level), spread))
    return {name: np.stack(values) for name, values in found.items() if np.isfinite(values).any((1, 2) if np.ndim(
        values) == 3 else 1).all()}


def _second(values):
    """Return second differences (ping, beam - 2) scaled to the noise of one value."""
    return (values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]) / np.sqrt(6)


def _from_ping_to_ping(line, angle, share, bins):
    """Return the spread of second differences from ping to ping at one beam, per head."""
    head = line["head"].values if "head" in line else np.zeros(line.sizes["ping"], int)
    near = SAME_BEAM * np.nanmedian(np.abs(np.diff(angle, axis=1)))
    angles, found = [], []
    for number in np.unique(head):
        chosen = head == number
        turned, values = angle[chosen].T, share[chosen].T
        together = np.abs(_second(turned)) < near
        angles.append(turned[:, 1:-1].ravel())
        found.append(np.where(together, _second(values), np.nan).ravel())
    return bins.over(np.concatenate(angles), np.concatenate(found), spread)


def _detections(lines, angles, bins, remarks):
    """Return shares of valid soundings and of those by phase, and where the simulated line is silent."""
    shares, phases = [], []
    for line, angle in zip(lines, angles):
        valid = line["valid"].values
        shares.append(100 * bins.over(_nominal(line, angle), valid.astype(float), "mean"))
        known = "detection" in line and (line["detection"].values[valid] > 0).any()
        by_phase = np.where(valid, 100.0 * (line["detection"].values == BY_PHASE), np.nan) if known else \
            np.full(valid.shape, np.nan)
        phases.append(bins.over(angle, by_phase, "mean"))
    pings = sum((bins.count(ping) > 0).astype(int) for ping in angles[0])
    silent = (pings >= COMMON * len(angles[0])) & (bins.count(angles[1]) == 0)
    if silent.any():
        middle = ", ".join(f"{angle:.0f}" for angle in deg_from_radians(bins.middle[silent]))
        remarks.append(f"the simulated line has no sounding in {silent.sum()} bins of angle where the real one has: "
                       f"about {middle} degrees")
    found = {"valid_share": np.stack(shares), "silent": silent}
    return found | ({"phase_share": np.stack(phases)} if np.isfinite(phases).any(1).all() else {})


def _nominal(line, angle):
    """Return the angle of every beam (ping, beam), of lost soundings the median of the beam's others."""
    head = line["head"].values if "head" in line else np.zeros(line.sizes["ping"], int)
    found = angle.copy()
    for number in np.unique(head):
        chosen = head == number
        known = np.isfinite(angle[chosen]).any(0)
        if not known.any():
            continue
        middle = np.full(known.size, np.nan)
        middle[known] = np.nanmedian(angle[chosen][:, known], axis=0)
        beams = np.arange(known.size)
        middle = np.interp(beams, beams[known], middle[known], np.nan, np.nan)
        found[chosen] = np.where(np.isfinite(found[chosen]), found[chosen], middle)
    return found
