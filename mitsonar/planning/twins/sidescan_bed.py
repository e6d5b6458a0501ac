"""Bed under a recorded sidescan line: its depths, its strength from place to place, and the gain of the recorder.

    L(R) = SL + 10 log [µ (h/R)² Φ(h'/R) b²(h'/R) c τ / 2] - 30 log R - 2 α R
    20 log s = L + G(R) - A,   G(R) = k log R + 2 α R

of a level Lambert bed of strength µ (Urick 1983, ch. 8): Φ the two-way equivalent width of the beam in azimuth, b² the
two-way pattern across the track, h the altitude, h' the first return, α the absorption, s the amplitude that the
recorder has of it, A its full scale.

A record determines neither k, A and µ nor the pattern apart from each other. The gain k is the one under which a bed of
one µ, seen by the preset's beams, is most even over range. A is set so that the median of µ is `USUAL_DB`. What remains
is the map of µ: the line's own variation by range, of which some may be the pattern's, and along the track.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.scattering.surfaces.glints import FEWEST, MOST
from mitsonar.signal.gates import speckle_gates
from mitsonar.sonar.faces.faces import BuiltFace
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.units import db_from_power, power_from_db, radians_from_deg
from mitsonar.water import absorption_db

from .sidescan_line import SidescanLine
from .sidescan_recorder import FoundNoise, FoundRecorder, noise_of

USUAL_DB = -27.0                   # 10 log µ of sand
BRIGHTEST, DARKEST_USUAL_DB = 0.999, -45.0                 # share of the record within the map's limits; least median
LOUDEST_DB, QUIETEST_DB = -5.0, -70.0                      # of the map
QUIETEST_NOISE_DB = -200.0         # none
USUAL_GAIN, LARGEST_GAIN = 30.0, 60.0                      # [dB] per factor of 10 in range
LEAST_SPAN = 0.25                  # of log R over which a gain is fitted
FROM = 1.3                         # times the first return, from where a gain is fitted
SPREAD = 3.0                       # measured over even beds of 20 to 400 glints a square metre
SAMPLES = 64                       # of the record in a cell of the map
MOST_CELLS = 4_000_000
NODE = 0.1                         # of the altitude: distance of the bed's nodes
FLATTEST = 4001                    # directions over which a beam is integrated


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundBed:
    """Bed of a twin and the recorder's gain over it."""

    depths: xr.Dataset  # depth (y, x) [m], with `cell` and `crs`
    strength_db: np.ndarray  # (Y, X): 10 log µ, from south to north over all nodes
    gain: float  # [dB]: per factor of 10 in range
    full_scale_db: float  # [dB re 1 µPa]
    sides_db: tuple[float, float]  # gains of port and starboard beside it
    noise: FoundNoise
    glints: float  # [1/m²]
    self_noise_db: float  # [dB re 1 µPa²/Hz]: of what is before the gain
    words: tuple[str, ...]


def bed_of(line: SidescanLine, recorder: FoundRecorder, preset: Mapping[str, Any], *, cell: float | None = None
           ) -> FoundBed:
    """Return the bed of a line as a sonar with a preset's attributes sees it, on cells of the given side [m]."""
    level = _levels(line, preset)                          # (P, S) [dB], -inf before the first return
    output = recorder.output(line.counts)
    R = np.maximum(line.slant_range, 1.0)                  # the recorder's gain is constant before
    gain, full_scale, sides, words = _gain(line, recorder, output, level)
    alpha = float(absorption_db(1e3 * preset["frequency_khz"], depth=max(-float(line.place[:, 2].mean()), 0.0)))
    gained = 10 ** ((gain * np.log10(R) + 2 * alpha * R) / 10)
    noise = noise_of(line, recorder, gained)
    words += noise.words
    # the gain makes up for the absorption
    expected = 10 ** ((level + gain * np.log10(R) - full_scale) / 20)
    east, north = _places(line)
    margin = float(line.slant_range[-1]) + 2.0
    step = cell or float(f"{np.sqrt(SAMPLES * line.spacing * max(line.step, line.spacing)):.2g}")
    node = max(NODE * float(np.median(line.altitude)), step)
    x, y = (_axis(line.place[:, axis], margin, node) for axis in (0, 1))
    step = max(step, float(np.sqrt(np.ptp(x) * np.ptp(y) / MOST_CELLS)))
    usable = np.isfinite(level) & recorder.usable[:, None]
    sums = np.zeros((4, *(max(1, int(np.ceil(np.ptp(axis) / step))) for axis in (y, x))))
    for side in (0, 1):
        row = np.clip(((north[side] - y[0]) / np.ptp(y) * sums.shape[1]).astype(int), 0, sums.shape[1] - 1)
        column = np.clip(((east[side] - x[0]) / np.ptp(x) * sums.shape[2]).astype(int), 0, sums.shape[2] - 1)
        at = (row * sums.shape[2] + column)[usable]
        here = expected * 10 ** (sides[side] / 20)
        there = np.broadcast_to(noise.own + noise.common + noise.before * gained, here.shape)
        for number, values in enumerate((output[:, side], here, there, np.ones_like(here))):
            sums[number] += np.bincount(at, values[usable], sums[0].size).reshape(sums[0].shape)
    strength, usual, clipped = _strengths(sums, recorder)
    full_scale += usual - USUAL_DB
    words.append(f"the bed is a map of strength in cells of {step:.2g} m, from {np.quantile(strength, 0.05):.0f} to "
                 f"{np.quantile(strength, 0.95):.0f} dB (5 to 95 %), with a median of {usual:.3g} dB that is assumed"
                 + (f"; {100 * clipped:.2g} % of its cells are at its limit of {LOUDEST_DB:g} dB" if clipped else ""))
    chirp = max(preset["chirp_ms"], preset["pulse_ms"]) / 1e3
    # in the compressed pulse's band, see `survey.sidescan.kind.noise_db`
    quiet = QUIETEST_NOISE_DB if noise.before < 1e-30 else float(
        db_from_power(noise.before * chirp) + full_scale)
    return FoundBed(depths=_depths(line, x, y, node), strength_db=strength, gain=gain, full_scale_db=full_scale,
                    sides_db=sides, noise=noise, glints=_glints(line, recorder, preset), self_noise_db=quiet,
                    words=tuple(words))


def _glints(line, recorder, preset):
    """Return the density [1/m²] of glints that has the record's number of them in a gate of speckle; 0 for none.

    The cell is that of a line's two-way beam, (∫ b)² / ∫ b² = 1.05 of its width, at the middle of the bed, times
    `SPREAD`: glints of a rendered bed vary its speckle as much as those of a cell so much larger would.
    """
    gate = line.spacing / speckle_gates(line.spacing, 0.5 * line.sound_speed * preset["pulse_ms"] / 1e3)
    middle = 0.5 * float(line.slant_range[-1] + np.median(line.first))
    cell = SPREAD * 1.05 * radians_from_deg(preset["beam_width_deg"]) * middle * gate
    density = recorder.glints[0] / cell
    return float(f"{density:.2g}") if FEWEST <= density <= MOST else 0.0


def _levels(line, preset):
    """Return the levels (P, S) [dB re 1 µPa] of a level Lambert bed of `USUAL_DB`, without absorption."""
    from scipy.integrate import trapezoid

    wavelength = line.sound_speed / (1e3 * preset["frequency_khz"])
    face = BuiltFace(width=radians_from_deg(preset["beam_width_deg"]),
                     vertical_width=radians_from_deg(preset["vertical_beam_width_deg"]),
                     floor=float(power_from_db(preset["sidelobe_db"])),
                     vertical_floor=float(power_from_db(preset["vertical_sidelobe_db"]))).aperture(wavelength)
    sonar = Sidescan(frequency=1e3 * preset["frequency_khz"], source_level_db=preset["source_level_db"],
                     pulse_length=preset["pulse_ms"] / 1e3, transmit=face, receive=face,
                     depression_angle=radians_from_deg(preset["depression_deg"]), sound_speed=line.sound_speed)
    sine = np.sin(np.linspace(0, np.pi / 2, 400)[1:])                          # of the depression, in the fan
    azimuth = np.linspace(0, 1, FLATTEST) ** 3 * np.pi / 2                     # dense where the beam is
    width = np.array([2 * trapezoid(sonar.along_intensity(np.sqrt(1 - one * one) * np.sin(azimuth)), azimuth)
                      for one in sine])
    across = sonar.across_intensity(np.sin(np.arcsin(sine) - sonar.depression_angle))
    factor_db = 10 * np.log10(np.maximum(sine ** 2 * width * across * sonar.resolution, 1e-30))
    ratio = line.first[:, None] / line.slant_range
    with np.errstate(divide="ignore"):
        found = np.interp(ratio, sine, factor_db) + 20 * np.log10(np.cos(line.pitch))[:, None]
    found += sonar.source_level_db + USUAL_DB - 30 * np.log10(line.slant_range)
    return np.where(ratio < 1, found, -np.inf)


def _gain(line, recorder, output, level):
    """Return the gain k [dB], the full scale A [dB re 1 µPa], the gains of the sides [dB], and clauses."""
    R, words = line.slant_range, []
    fitted = (R > FROM * line.first[:, None]) & recorder.usable[:, None]
    off, weight = np.full((2, R.size), np.nan), np.zeros((2, R.size))
    for side in (0, 1):
        # the mean before the logarithm, so that saturation and noise can be taken out of it
        count = fitted.sum(0)
        mean = np.where(fitted, output[:, side], 0).sum(0) / np.maximum(count, 1)
        there = (count >= 8) & (mean > 0)
        bed = 10 * np.log10(np.where(fitted, 10 ** (np.where(fitted, level, 0) / 10), 0).sum(0)
                            / np.maximum(count, 1) + 1e-300)
        off[side, there] = (20 * np.log10(recorder.scale(mean[there])) - bed[there])
        weight[side, there] = count[there]
    known = np.isfinite(off)
    if not known.any():
        raise ValueError("no bed lies beyond the first return of the line; choose one of a longer range.")
    sides = np.zeros(2)
    for side in (0, 1):
        both = known[side] & known[1 - side]
        if both.any():
            sides[side] = 0.5 * float(np.median(off[side][both] - off[1 - side][both]))
    even = np.nanmean(np.where(known, off - sides[:, None], np.nan)[:, known.any(0)], axis=0)
    log_range = np.log10(np.maximum(R, 1.0))[known.any(0)]
    gain = USUAL_GAIN
    if np.ptp(log_range) >= LEAST_SPAN:
        # samples are even in R; weights make them even in log R
        gain = float(np.polyfit(log_range, even, 1, w=10 ** (-0.5 * log_range))[0])
        gain = round(float(np.clip(gain, 0.0, LARGEST_GAIN)), 1)
        words.append(f"gain of the recorder: {gain:g} dB per factor of 10 in range and the water's absorption, under "
                     "which an even Lambert bed is as even as this record")
    else:
        words.append(f"the record is too short in range for its gain: {gain:g} log R is assumed")
    rest = even - gain * log_range
    full_scale = -float(np.median(rest))
    left = rest + full_scale
    words.append(f"over range the record differs from that by {np.sqrt(np.mean(left ** 2)):.2g} dB rms, which the map "
                 "of the bed has; port is " + (f"{sides[0] - sides[1]:.2g} dB above starboard" if sides[0] >= sides[1]
                                            else f"{sides[1] - sides[0]:.2g} dB below starboard"))
    return gain, full_scale, (float(sides[0]), float(sides[1])), words


def _places(line):
    """Return east and north, each (2, P, S) [m], of the bed at the samples of port and starboard."""
    ahead = line.altitude * np.tan(line.pitch)
    sine, cosine = np.sin(line.heading), np.cos(line.heading)
    across = np.sqrt(np.maximum(line.slant_range ** 2 - line.first[:, None] ** 2, 0))
    middle = line.place[:, 0] + ahead * sine, line.place[:, 1] + ahead * cosine
    return tuple(np.stack([middle[axis][:, None] + sign * across * turned[:, None] for sign in (-1, 1)])
                 for axis, turned in ((0, cosine), (1, -sine)))


def _axis(values, margin, node):
    """Return nodes [m] that cover values and a margin."""
    low, high = values.min() - margin, values.max() + margin
    return low + node * np.arange(int(np.ceil((high - low) / node)) + 1)


def _strengths(sums, recorder):
    """Return the map of 10 log µ (Y, X) without holes, its median, and the share of the record at its upper limit.

    The median is lowered where the brightest of the record would exceed what a bed can have.
    """
    from scipy.ndimage import distance_transform_edt

    known = sums[3] > 0
    row, column = distance_transform_edt(~known, return_distances=False, return_indices=True)
    mean, expected, noise = sums[:3] / np.maximum(sums[3], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = 20 * np.log10(np.maximum(recorder.scale(mean, noise), 1e-6) / expected)
    order = np.argsort(found[known])
    weight = np.cumsum(sums[3][known][order])
    brightest = found[known][order][np.searchsorted(weight, BRIGHTEST * weight[-1])]
    usual = float(np.clip(LOUDEST_DB - brightest, DARKEST_USUAL_DB, USUAL_DB))
    found = found + usual
    clipped = float((sums[3] * (found > LOUDEST_DB))[known].sum() / sums[3].sum())
    return np.clip(found[row, column], QUIETEST_DB, LOUDEST_DB).astype(np.float32), usual, clipped


def _depths(line, x, y, node):
    """Return the depths of the bed: at every node that below the nearest part of the track, smoothed."""
    from scipy.ndimage import gaussian_filter
    from scipy.spatial import cKDTree

    ahead = line.altitude * np.tan(line.pitch)
    below = np.column_stack([line.place[:, 0] + ahead * np.sin(line.heading),
                             line.place[:, 1] + ahead * np.cos(line.heading)])
    depth = line.altitude - line.place[:, 2]
    nearest = cKDTree(below).query(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))[1]
    values = gaussian_filter(depth[nearest].reshape(y.size, x.size), 2.0, mode="nearest")
    east, north = line.frame.origin
    return xr.Dataset(
        {"depth": (("y", "x"), values[::-1].astype(np.float32), {"units": "m"})},
        coords={"y": y[::-1] + north, "x": x + east},
        attrs={"cell": float(node), "crs": line.frame.crs or None, "origin": line.frame.origin})
