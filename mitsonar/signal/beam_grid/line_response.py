"""Response of a line of elements to a grid's rows: the spectrum of its pattern over rows, at every frequency.

    W_f(y) = Σ_n w_n e^{-2πi x_n (1 + f/f0) y/λ} / Σ|w_n|,       Ŵ_f(ν) = Σ_m W_f(m ds) e^{-2πi ν m}            (1)

x_n -> ``position`` on the axis, w_n -> ``weight``, ds the step of the rows' sines, ν cycles a row. W
is one function of (1 + f/f0) y/λ, whatever the frequency: a table of it serves all, for elements anywhere on the line.
Beyond the array's own band, |ν| <= max |x_n| (1 + f/f0) ds/λ, Ŵ rolls off; it is divided by the bell's spectrum once
for what was spread over rows, once for what is read from them.

An aperture of a part of the line has a narrower band, about its own middle ν_c. Turned back by e^{2πi ν_c u} its beams
need fewer rows, every ``stride``-th (`ResponseRows`); the turn is made good where they are read.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline

from mitsonar.sonar.arrays.array_factor import array_factor

from ..impulses import Bell

FINER = 12                         # places of the table over those that resolve the line: a spline errs by 1e-5
TURNS = 8                          # in which a spectrum of noise is found
NOISE_STEP = 1 / 8                 # ν's by which elements move at most between frequencies at which it is found
BLOCK = 1 << 15                    # numbers worked on at once: they stay in a cache
TOGETHER = 16                      # rows that are transformed side by side, so blocks have a multiple of them
OVERSAMPLING = 1.9                 # rows over those that a line resolves
FADE = 64                          # rows, at both ends together
ROLL_OFF = 0.03, 0.15              # [cycles a row], of the band: width of the roll-off
KEPT, MOST_KEPT = 8, 1 << 21       # responses that are kept for the next image, and numbers in one of them
WIDE = 0.2, 0.7                    # the same for lines so short that a fading pattern is wider than they


@dataclass(frozen=True, kw_only=True)
class ResponseRows:
    """Rows of beams, over which transforms run."""

    step: float  # ds
    period: int  # of them
    before: int  # beams lie at most so many rows before an echo, and less than ``period - before`` rows after it

    def every(self, stride: int) -> ResponseRows:
        """Return every `stride`-th of them."""
        return ResponseRows(step=self.step * stride, period=self.period // stride, before=self.before // stride)

    @property
    def numbers(self) -> np.ndarray:
        """Return the numbers of rows from an echo to a beam, int (period,), in order of an FFT."""
        return (np.arange(self.period) + self.before) % self.period - self.before


class LineResponse:
    """Ŵ of the module, for rows a step apart."""
    # position (E,) [m]; weight (E,) [-]; wavenumber (F,) [1/m]; taken (U,); used (U,); values (F, U); spectrum (U,)
    # [-]

    def __init__(self, position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, rows: ResponseRows,
                 stride: int = 1):
        farthest = float(np.abs(position).max())
        lowest, highest = _extent(position, weight) if stride > 1 else (-farthest, farthest)
        # pairs of waves over rows are pairs over the rows of beams
        self.middle = -2 * int(round(0.25 * (lowest + highest) * wavenumber.max() * rows.step * rows.period))
        self.rows = own = rows.every(stride)
        number = fft.fftfreq(own.period, 1 / own.period)
        nu = fft.fftfreq(own.period)
        band = float(0.5 * (highest - lowest) * wavenumber.max() * own.step)
        skirt = stride * max(ROLL_OFF[0], ROLL_OFF[1] * band, WIDE[0] - WIDE[1] * band)
        self.used = np.flatnonzero(np.repeat((np.abs(nu) <= band + skirt).reshape(-1, 2).any(1), 2))
        self.taken = (number[self.used].astype(np.int64) + self.middle) % rows.period
        self.bell = Bell(0.5 / OVERSAMPLING)            # the same for all lines, whose kernels are one then
        self.spectrum = self.bell.spectrum(nu[self.used]) * self.bell.spectrum(fft.fftfreq(rows.period)[self.taken])
        roll = np.cos(0.5 * np.pi * np.clip((np.abs(nu[self.used]) - band) / skirt, 0, 1)) ** 2
        self._turn, self._fade = -self.middle * stride / rows.period, FADE // stride
        self._scale, self._weight, self._position, self._wavenumber = np.abs(weight).sum(), weight, position, wavenumber
        self.values = np.empty((len(wavenumber), len(self.used)), np.complex64)
        gain, taper = (roll / self.spectrum).astype(np.float32), _taper(own, self._fade)
        for part, values in self._pattern(weight / self._scale, wavenumber, own):
            values *= taper
            np.multiply(fft.fft(values, axis=1, overwrite_x=True)[:, self.used], gain, out=self.values[part])
        self._noise: dict[float, np.ndarray] = {}

    def own_noise(self, farthest: float) -> np.ndarray:
        """Return the power of white noise of variance 1 at every element, read from rows at the ν used: (F, U) [-].

        Its transform must be Σ|w_n|² e^{-2πi x_n (1 + f/f0) y/λ} / (Σ|w_n|)² for |y| <= `farthest`, and it must be
        positive: alternating projections meet both conditions. Accurate to 0.01 of the level for 32 elements and more,
        to 0.1 for a few elements, at beams far from each other. Found at some frequencies, between which an element's
        ν hardly moves, and interpolated.
        """
        if farthest not in self._noise:
            self._noise = {farthest: self._projected_noise(farthest)}
        return self._noise[farthest]

    def _projected_noise(self, farthest: float) -> np.ndarray:
        rows = replace(self.rows, before=self.rows.period // 2)
        lowest, highest = self._wavenumber.min(), self._wavenumber.max()
        moved = np.abs(self._position).max() * (highest - lowest) * rows.step * rows.period
        places = min(int(np.ceil(moved / NOISE_STEP)) + 1, len(self._wavenumber))
        weight = np.abs(self._weight / self._scale) ** 2
        wanted = np.concatenate([
            values for _, values in self._pattern(weight, np.linspace(lowest, highest, places), rows)])
        near = np.abs(rows.numbers) * rows.step <= farthest
        power = np.real(fft.fft(wanted * _taper(rows, self._fade), axis=1))
        for _ in range(TURNS):
            found = fft.ifft(np.maximum(power, 0), axis=1)
            found[:, near] = wanted[:, near]
            power = np.real(fft.fft(found, axis=1, overwrite_x=True))
        power = np.maximum(power, 0)
        power *= np.real(wanted[:, :1]) / power.mean(axis=1, keepdims=True)
        power = power[:, self.used] / self.spectrum.astype(np.float32)
        place = (self._wavenumber - lowest) * ((places - 1) / max(highest - lowest, 1e-300))
        before = np.minimum(place.astype(int), max(places - 2, 0))
        share = (place - before)[:, None].astype(np.float32)
        return power[before] * (1 - share) + power[np.minimum(before + 1, places - 1)] * share

    def _pattern(self, weight: np.ndarray, wavenumber: np.ndarray,
                 rows: ResponseRows) -> Iterator[tuple[slice, np.ndarray]]:
        """Yield W_f(m ds) of weights (E,) as they are, turned back, m in order of an FFT: complex64 (F, period).

        They come in blocks of frequencies, each with its place. Arrays of all would cost more to allocate than to fill.
        """
        number = rows.numbers
        farthest = np.abs(wavenumber).max() * rows.step * np.abs(number).max()
        spacing = 1 / (2 * FINER * max(float(np.abs(self._position).max()), 1e-9))
        middle = int(np.ceil(farthest / spacing)) + 4
        cubic, *others = _splines(array_factor(-self._position, weight, first=-middle * spacing, step=spacing,
                                               count=2 * middle + 1))
        turn = np.exp(2j * np.pi * self._turn * number).astype(np.complex64)
        several = TOGETHER * max(1, BLOCK // (TOGETHER * rows.period))
        for first in range(0, len(wavenumber), several):
            part = slice(first, first + several)
            place = np.multiply.outer(wavenumber[part] * (rows.step / spacing), number) + middle
            cell = place.astype(np.intp)
            place -= cell
            t = place.astype(np.complex64)
            values = cubic.take(cell)
            for coefficient in others:                                   # ((a t + b) t + c) t + d
                values *= t
                values += coefficient.take(cell)
            if self.middle:
                values *= turn
            yield part, values


def _splines(values: np.ndarray) -> np.ndarray:
    """Return the coefficients of the cubic spline through values a step apart, complex64 (4, cells)."""
    return CubicSpline(np.arange(len(values)), values).c.astype(np.complex64)


_kept: dict[tuple[object, ...], LineResponse] = {}         # the last ones: images of one sonar share them


def response_of(position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, rows: ResponseRows,
                stride: int) -> LineResponse:
    """Return the response of a line, which is made once for images of the same line, pulse and water."""
    asked = *((part.dtype.str, part.tobytes()) for part in (position, weight, wavenumber)), rows, stride
    made = _kept.pop(asked, None) or LineResponse(position, weight, wavenumber, rows, stride)
    if made.values.size <= MOST_KEPT:
        _kept[asked] = made
        for oldest in list(_kept)[:-KEPT]:
            _kept.pop(oldest, None)
    return made


def stride_of(position: np.ndarray, weights: np.ndarray) -> int:
    """Return how many rows apart the beams of apertures (K, E) can be: 2 where none is longer than half the line."""
    whole = 2 * np.abs(position).max(initial=0)
    longest = max(high - low for low, high in (_extent(position, one) for one in weights))
    return 2 if len(weights) > 1 and 2 * longest <= whole * (1 + 1e-9) else 1


def _extent(position: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Return from where to where an aperture reaches [m]."""
    there = position[weight != 0]
    return float(there.min()), float(there.max())


def _taper(rows: ResponseRows, fade: int) -> np.ndarray:
    """Return the taper of a pattern at both ends of a period, float32 (period,), in order of an FFT."""
    place = rows.numbers + rows.before + 0.5 * (rows.period % 2)
    left = np.minimum(place, rows.period - place)
    fading = np.clip(1 - 2 * left / fade, 0, 1)
    return np.cos(0.5 * np.pi * fading).astype(np.float32) ** 2
