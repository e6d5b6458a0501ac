"""What a line of elements makes of a grid's rows: its pattern as a spectrum over them, at every frequency.

    W_f(y) = Σ_n w_n e^{-2πi x_n (1 + f/f0) y/λ} / Σ|w_n|,       Ŵ_f(ν) = Σ_m W_f(m ds) e^{-2πi ν m}            (1)

x_n -> ``position`` on the axis, w_n -> ``weight``, ds the step of the rows' sines, ν cycles a row. W
is one function of (1 + f/f0) y/λ, whatever the frequency: a table of it serves all, for elements anywhere on the line.
Beyond the array's own band, |ν| <= max |x_n| (1 + f/f0) ds/λ, Ŵ rolls off; it is divided by the bell's spectrum once
for what was spread over rows, once for what is read from them.
"""
from __future__ import annotations

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline

from ..bells import Bell

__all__ = ["FADE", "FINER", "LineResponse", "OVERSAMPLING"]

FINER = 12                         # places of the table over those that resolve the line: a spline errs by 1e-5
TURNS = 8                          # in which a spectrum of noise is found
BLOCK = 1 << 21                    # numbers worked on at once
OVERSAMPLING = 1.9                 # rows over those that a line resolves
FADE = 64                          # rows, at both ends together
ROLL_OFF = 0.03, 0.15              # [cycles a row], of the band: width of the roll-off
WIDE = 0.2, 0.7                    # the same for lines so short that a fading pattern is wider than they


class LineResponse:
    """Ŵ of the module, for rows a step apart.

    Parameters
    ----------
    position : (E,) [m]
    weight : complex (E,) [-]
    wavenumber : (F,) [1/m]
        (1 + f/f0) / λ.
    step : float [-]
        ds.
    rows : int
        Of a period; over the last FADE of them W goes to 0.

    Attributes
    ----------
    used : (U,) int
        Numbers of the ν that are not left out, in order of an FFT.
    values : complex64 (F, U)
        Ŵ over the bell's spectrum squared.
    bell : Bell
        Over rows.
    spectrum : (U,) [-]
        Of the bell, at the ν that are used.
    """

    def __init__(self, position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, step: float, rows: int):
        nu = fft.fftfreq(rows)
        band = float(np.abs(position).max() * wavenumber.max() * step)
        skirt = max(ROLL_OFF[0], ROLL_OFF[1] * band, WIDE[0] - WIDE[1] * band)
        self.used = np.flatnonzero(np.abs(nu) <= band + skirt)
        self.bell = Bell(0.5 / OVERSAMPLING)            # the same for all lines, whose kernels are one then
        self.spectrum = self.bell.spectrum(nu[self.used])
        roll = np.cos(0.5 * np.pi * np.clip((np.abs(nu[self.used]) - band) / skirt, 0, 1)) ** 2
        self._line = position, step, rows
        self._scale, self._weight, self._wavenumber = np.abs(weight).sum(), weight, wavenumber
        values = fft.fft(_pattern(position, weight / self._scale, wavenumber, step, rows) * _taper(rows), axis=1,
                         overwrite_x=True)
        self.values = np.ascontiguousarray(values[:, self.used] * (roll / self.spectrum ** 2).astype(np.float32))

    def own_noise(self, farthest: float) -> np.ndarray:
        """Give the power of white noise of variance 1 at every element, read from rows at the ν used: (F, U) [-].

        Its transform is to be Σ|w_n|² e^{-2πi x_n (1 + f/f0) y/λ} / (Σ|w_n|)² for |y| <= `farthest`, and it is to be
        positive: found by meeting the one and the other by turns. Right to 0.01 of the level for 32 elements and more,
        to 0.1 for a few of them, at beams far from each other.
        """
        position, step, rows = self._line
        wanted = _pattern(position, np.abs(self._weight / self._scale) ** 2, self._wavenumber, step, rows)
        near = np.abs(np.fft.ifftshift(np.arange(rows) - rows // 2)) * step <= farthest
        power = np.real(fft.fft(wanted * _taper(rows), axis=1))
        for _ in range(TURNS):
            found = fft.ifft(np.maximum(power, 0), axis=1)
            found[:, near] = wanted[:, near]
            power = np.real(fft.fft(found, axis=1, overwrite_x=True))
        power = np.maximum(power, 0)
        power *= np.real(wanted[:, :1]) / power.mean(axis=1, keepdims=True)
        return power[:, self.used] / (self.spectrum ** 2).astype(np.float32)


def _pattern(position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, step: float, rows: int) -> np.ndarray:
    """Give W_f(m ds) of weights (E,) as they are, m in order of an FFT: complex64 (F, rows)."""
    farthest = np.abs(wavenumber).max() * step * (rows // 2)
    spacing = 1 / (2 * FINER * max(float(np.abs(position).max()), 1e-9))
    at = np.linspace(-farthest, farthest, 2 * int(np.ceil(farthest / spacing)) + 9)
    parts = np.array_split(at, -(-at.size * position.size // BLOCK))
    pattern = CubicSpline(at, np.concatenate([np.exp(-2j * np.pi * np.multiply.outer(some, position)) @ weight
                                              for some in parts]))
    row = np.fft.ifftshift(np.arange(rows) - rows // 2)
    values = np.empty((len(wavenumber), rows), np.complex64)
    for part in np.array_split(np.arange(len(wavenumber)), -(-values.size // BLOCK)):
        values[part] = pattern(np.multiply.outer(wavenumber[part] * step, row))
    return values


def _taper(rows: int) -> np.ndarray:
    """What lets a pattern fade at half a period, float32 (rows,), in order of an FFT."""
    row = np.abs(np.fft.ifftshift(np.arange(rows) - rows // 2))
    fading = np.clip(2 * (row - 0.5 * (rows - FADE)) / FADE, 0, 1)
    return np.cos(0.5 * np.pi * fading).astype(np.float32) ** 2
