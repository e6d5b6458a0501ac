"""Sidescan image from the echo energy per time bin: pulse, speckle, noise, levels.

    p²(t) = Σ_j k_j E_j + N,      k the pulse's share of each (half) bin                     mean level
    z(t)  = Σ_j √k_j √E_j g_j + √N n,  p² = |z|²                                             one realisation

E -> ``intensity`` [µPa²] of the echoes that arrive in bin j, N noise, g -> ``speckle`` and n circular complex Gaussian
of unit variance: the sum of many scatterers in a resolution cell (Rayleigh reverberation; Jackson & Richardson 2007,
ch. 16), which stay in place from ping to ping (`echoes.ground_speckle`). A bin longer than the pulse holds several
cells, whose intensities are averaged. Coherent echoes z_c of point targets and smooth surfaces add before squaring: to
the mean <|z_c|²>, and to a realisation <|z + z_c|²> over each cell, with one number z per cell. Amplitudes are then
Rice distributed (S. O. Rice, 1945).

A recorder with a peak detector writes the highest intensity of a window in place of that of a bin:

    p²_peak(t) = max |z(t')|²,      |t' - t| < W Δt / 2

W -> ``peak_window`` [bins]. Cells that begin between those of a bin have sums of the scatterers of both.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray

from mitsonar.signal.gates import between, envelope_steps, highest, pulse_shares, speckle_gates
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.sonar.motion.track import Track
from mitsonar.units import power_from_db

from . import picture
from .energy_record import CoherentRecord, EnergyRecord
from .leakage import leaked, leaked_pressure

DIMS = ("ping", "side", "range")
WORK = 1 << 18                     # bins drawn at a time
FEW_CELLS = 64                     # fewer bins if they have more cells than this


def mean_intensity(intensity: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return the mean intensity (..., bins) [µPa²] of echoes (..., bins) under a pulse with `shares`."""
    if len(shares) == 1:
        return intensity * shares[0]
    return _gate(np.repeat(0.5 * intensity, 2, -1), shares)


def realisation(intensity: np.ndarray, shares: np.ndarray, speckle: np.ndarray, noise: float,
                random: np.random.Generator, coherent: np.ndarray | None = None,
                coherent_intensity: np.ndarray | float = 0.0, leakage: float = 0.0) -> np.ndarray:
    """Draw received intensities (..., bins) [µPa²] from mean ones, speckle (..., gates) and noise [µPa²].

    ``coherent`` (..., bins, cells) [µPa] and ``coherent_intensity`` (..., bins) [µPa²] are echoes with a known phase.
    """
    if len(shares) == 1:
        cells = speckle.shape[-1] // intensity.shape[-1]
        amplitude = np.sqrt(shares[0] * intensity)
        speckle = speckle.reshape(*intensity.shape, cells)
        echo = np.zeros(intensity.shape)
        for cell in range(cells):
            z = leaked_pressure(amplitude * speckle[..., cell], leakage)
            if noise:
                z += np.sqrt(noise) * _gaussian(random, intensity.shape)
            echo += np.abs(z) ** 2 + _crossed(z, coherent, cell)
        return np.maximum(echo / cells + coherent_intensity, 0)
    z = leaked_pressure(_gate(np.sqrt(np.repeat(0.5 * intensity, 2, -1)) * speckle, np.sqrt(shares)), leakage)
    if noise:
        # noise has the band of the pulse; drawn beyond both ends, it keeps its level there
        drawn = _gaussian(random, (*speckle.shape[:-1], speckle.shape[-1] + len(shares) - 2))
        z += np.sqrt(noise / shares.sum()) * _sums(drawn, np.sqrt(shares))
    return np.maximum(np.abs(z) ** 2 + _crossed(z, coherent, 0) + coherent_intensity, 0)


def peaks(intensity: np.ndarray, shares: np.ndarray, speckle: np.ndarray, noise: float, random: np.random.Generator,
          window: float, coherent: np.ndarray | None = None, coherent_intensity: np.ndarray | None = None,
          leakage: float = 0.0) -> np.ndarray:
    """Draw the highest intensities (..., bins) [µPa²] of windows of so many bins about each.

    Arguments are those of `realisation`, with ``speckle`` (..., gates, steps); from a generator in the same state, the
    noise is the same.
    """
    drawn = None
    if noise and len(shares) == 1:
        cells = speckle.shape[-2] // intensity.shape[-1]
        drawn = np.stack([_gaussian(random, intensity.shape) for _ in range(cells)], -1)
    elif noise:
        drawn = _gaussian(random, (*speckle.shape[:-2], speckle.shape[-2] + len(shares) - 2))
    arrays = intensity, speckle, drawn, coherent, coherent_intensity
    if intensity.ndim < 3:
        return _peaks_of(*arrays, shares, noise, window, leakage)
    # a few pings (ping, side, ...) at a time: the steps of complex pressures take many times the memory of the picture
    few = max(1, WORK // speckle[:1].size)
    parts = ([None if array is None else array[first:first + few] for array in arrays]
             for first in range(0, len(intensity), few))
    return np.concatenate([_peaks_of(a, b, c, d, e, shares, noise, window, leakage) for a, b, c, d, e in parts])


def _peaks_of(intensity, speckle, drawn, coherent, coherent_intensity, shares, noise, window, leakage):
    """Return the highest intensities of a few pings, see `peaks`; ``drawn`` is noise of unit variance, or None."""
    if len(shares) == 1:
        cells, steps = speckle.shape[-2] // intensity.shape[-1], speckle.shape[-1]
        mean = between(np.repeat(shares[0] * intensity, cells, -1), steps)
        z = leaked_pressure(np.sqrt(mean) * speckle, leakage)
        if drawn is not None:
            z += np.sqrt(noise) * between(drawn.reshape(*intensity.shape[:-1], -1), steps, np.sqrt)
    else:
        cells, steps = 1, 2
        root = np.sqrt(shares)
        z = leaked_pressure(_gate(np.sqrt(np.repeat(0.5 * intensity, 2, -1)) * speckle[..., 0], root, 1), leakage)
        if drawn is not None:
            z += np.sqrt(noise / shares.sum()) * _sums(drawn, root, 1)
        # the last bin ends with its middle
        z = np.concatenate([z, z[..., -1:]], -1).reshape(*intensity.shape, steps)
    power = np.abs(z) ** 2
    if coherent is not None and coherent_intensity is not None:
        beside = between(coherent.reshape(*intensity.shape[:-1], -1), steps)
        power += 2 * np.real(z * np.conj(beside)) + between(np.repeat(coherent_intensity, cells, -1), steps)
    power = np.maximum(power.reshape(*intensity.shape[:-1], -1), 0)
    return highest(power, window, cells * steps)


def image(record: EnergyRecord, *, sonar: Sidescan, track: Track, depth_below: np.ndarray, window: tuple[float, float],
          labels: Mapping[int, str], class_of: Mapping[int, int], noise_db: float | None,
          speckle: Callable[[np.ndarray, int], np.ndarray] | None, seed: int, absorption_db: float,
          paths: Sequence[str] = ("b",), leakage: float = 0.0, peak_window: float = 0.0,
          first: int = 0) -> xarray.Dataset:
    """Return the image of a run over a time ``window`` [s], whose first ping has a number.

    ``noise_db`` [dB re 1 µPa], ``absorption_db`` [dB/m]. ``speckle`` is given the numbers of pings (B,) and of steps,
    and returns (B, side, gates, steps). With a ``peak_window`` [bins], the image has ``peak_level``, what a peak
    detector makes of the same echoes and noise.
    """
    pings, _, bins = record.intensity.shape
    bin_length = (window[1] - window[0]) / bins
    time = window[0] + (np.arange(bins) + 0.5) * bin_length
    shares = pulse_shares(bin_length, sonar.pulse_length)
    noise = 0.0 if noise_db is None else float(power_from_db(noise_db))
    level = np.empty((pings, 2, bins), np.float32)
    mean_level = np.empty_like(level)
    peak_level = np.empty_like(level) if peak_window else None
    steps = envelope_steps(bin_length, sonar.pulse_length) if peak_window else 1
    in_beam, coherent = record.echoes_in_beam, _coherent_arrays(record)
    depth = record.depth if coherent is None else record.depth.copy()
    # bounds the float64 work space for long surveys and many cells per bin
    many = max(1, speckle_gates(bin_length, sonar.pulse_length) // FEW_CELLS)
    step = max(1, WORK // (2 * bins * many))
    for start in range(0, pings, step):
        block = slice(start, start + step)
        energy = record.intensity[block].astype(float)
        mean, with_phase = leaked(mean_intensity(energy, shares), leakage), ()
        if coherent is not None:
            pressure, coherent_mean, coherent_depth = (array[block] for array in coherent)
            with_phase = leaked_pressure(pressure, leakage), leaked(coherent_mean.astype(float), leakage)
            depth[block] = _mean_depth(depth[block], mean, coherent_depth,
                                       np.where(in_beam[block] > 0, coherent_mean, 0))
            mean = mean + with_phase[1]
        mean_level[block] = picture.levels(mean)
        if speckle is not None:
            of_gates, key = speckle(first + np.arange(pings)[block], steps), [abs(int(seed)), first + start]
            drawn = realisation(energy, shares, of_gates[..., 0], noise, np.random.default_rng(key), *with_phase,
                                leakage=leakage)
            level[block] = picture.levels(drawn)
            if peak_level is not None:
                peak_level[block] = picture.levels(peaks(energy, shares, of_gates, noise, np.random.default_rng(key),
                                                         peak_window, *with_phase, leakage=leakage))
        else:
            level[block] = picture.levels(mean + noise)
            if peak_level is not None:
                peak_level[block] = level[block]
    beam_width, vertical_beam_width = sonar.transmit.beam_widths(sonar.wavelength)
    axis = picture.PictureBins(time=time, length=bin_length, sound_speed=sonar.sound_speed,
                               pulse_length=sonar.pulse_length)
    dataset = picture.picture(
        "sidescan", DIMS,
        {"level": picture.entry(DIMS, level, "dB re 1 µPa", "echo level"),
         "mean_level": picture.entry(DIMS, mean_level, "dB re 1 µPa", "echo level without speckle and noise")},
        replace(record, depth=depth), bins=axis, pings=picture.pings_of(track, depth_below, first),
        rows={"side": picture.SIDES}, labels=labels, class_of=class_of,
        attrs={"seed": int(seed), "frequency": float(sonar.frequency), "source_level_db": float(sonar.source_level_db),
               "pulse_length": float(sonar.pulse_length), "beam_width": beam_width,
               "vertical_beam_width": vertical_beam_width, "depression_angle": float(sonar.depression_angle),
               "absorption_db": float(absorption_db),
               "noise_db": None if noise_db is None else float(noise_db),
               "bin_width": axis.width, "speckle": speckle is not None})
    if peak_level is not None:
        dataset = dataset.assign(peak_level=picture.entry(DIMS, peak_level, "dB re 1 µPa",
                                                          "highest echo level about each bin"))
    if record.path_intensity is not None:
        dataset = dataset.assign(_by_path(record.path_intensity, record.coherent, shares)).assign_coords(
            path_name=("path_name", list(paths), {"long_name": "bounces: b seabed or object, s sea surface, v water"}))
    return dataset


def _coherent_arrays(record: EnergyRecord) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the pressure, intensity and depth of coherent echoes, or None."""
    coherent = record.coherent
    if coherent is None:
        return None
    if coherent.pressure is None or coherent.depth is None:
        raise ValueError("a sidescan's image adds coherent echoes as pressures, but the record has only their powers; "
                         "take a record of sides")
    return coherent.pressure, coherent.intensity, coherent.depth


def _by_path(intensity: np.ndarray, coherent_record: CoherentRecord | None, shares: np.ndarray) -> dict[str, tuple]:
    """Return the levels of every path (path_name, ping, side, range), and the number of the strongest path."""
    coherent = None if coherent_record is None else coherent_record.path_intensity
    pings, sides, paths, bins = intensity.shape
    level = np.empty((paths, pings, sides, bins), np.float32)
    step = max(1, WORK // (sides * paths * bins))
    for start in range(0, pings, step):
        block = slice(start, start + step)
        mean = mean_intensity(intensity[block].astype(float), shares)
        if coherent is not None:
            mean += coherent[block]
        level[:, block] = picture.levels(np.moveaxis(mean, 2, 0))
    if coherent is not None:
        intensity = intensity + coherent
    strongest = np.where(intensity.max(2) > 0, intensity.argmax(2) + 1, 0).astype(np.uint32)
    return {"path_level": picture.entry(("path_name", *DIMS), level, "dB re 1 µPa",
                                            "echo level of each path, without speckle and noise"),
            "path": picture.entry(DIMS, strongest, "1", "path with most of the echo, counted from 1; 0: no echo")}


def _mean_depth(depth, mean, coherent_depth, coherent_mean):
    """Return depths weighted by energy, with coherent echoes included."""
    there = (coherent_depth != 0) & (coherent_mean > 0)
    total = np.where(there, mean + coherent_mean, 1)
    known = np.where(np.isnan(depth), 0, depth)
    return np.where(there, (mean * known + coherent_mean * coherent_depth) / total, depth)


def _crossed(z, coherent, cell):
    """Return the interference term: |z + z_c|² less both squares."""
    return 0.0 if coherent is None else 2 * (z * np.conj(coherent[..., cell])).real


def _gate(half_bins: np.ndarray, weights: np.ndarray, every: int = 2) -> np.ndarray:
    """Return weighted sums of the half bins around the centre of every bin, or around the end of every half bin."""
    reach = len(weights) // 2
    edge = np.zeros((*half_bins.shape[:-1], reach - 1), half_bins.dtype)
    return _sums(np.concatenate([edge, half_bins, edge], -1), weights, every)


def _sums(padded: np.ndarray, weights: np.ndarray, every: int = 2) -> np.ndarray:
    last = padded.shape[-1] - len(weights) + 1
    total: np.ndarray = weights[0] * padded[..., 0:last:every]
    for j, weight in enumerate(weights[1:], 1):
        total = total + weight * padded[..., j:j + last:every]
    return total


def _gaussian(random, shape):
    pair = random.standard_normal((2, *shape))
    return (pair[0] + 1j * pair[1]) * np.sqrt(0.5)
