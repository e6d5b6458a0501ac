"""What a line of elements makes of a grid's rows: its pattern as a spectrum over them, at every frequency.

    W_f(y) = Σ_n w_n e^{-2πi x_n (1 + f/f0) y/λ} / Σ|w_n|,       Ŵ_f(ν) = Σ_m W_f(m ds) e^{-2πi ν m}            (1)
    W_f((32 a + b) ds) = Σ_n e^{-2πi 32 a θ_n} w_n e^{-2πi b θ_n},     θ_n = x_n (1 + f/f0) ds/λ                 (2)

x_n -> ``position`` on the axis, w_n -> ``weight``, ds the step of the rows' sines, ν cycles a row. (2) is one product
of two small matrices a frequency, for elements anywhere on the line. Beyond the array's own band, |ν| <= max |x_n|
(1 + f/f0) ds/λ, Ŵ rolls off; it is divided by the bell's spectrum once for what was spread over rows, once for what is
read from them.
"""
from __future__ import annotations

import numpy as np
from scipy import fft

from ..bells import Bell

__all__ = ["FADE", "LineResponse", "pattern_spectrum"]

BELOW = 32                         # b of (2) counts to it
BLOCK = 1 << 21                    # numbers worked on at once
FADE = 64                          # rows, at both ends together
ROLL_OFF = 0.03, 0.15              # [cycles a row], of the band: width of the roll-off
WIDE = 0.12, 0.4                   # the same for lines so short that a fading pattern is wider than they


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
        self.bell = Bell(min(max(band, 0.2), 0.4))
        self.spectrum = self.bell.spectrum(nu[self.used])
        roll = np.cos(0.5 * np.pi * np.clip((np.abs(nu[self.used]) - band) / skirt, 0, 1)) ** 2
        self._line = position, step, rows
        self._scale, self._weight, self._wavenumber = np.abs(weight).sum(), weight, wavenumber
        values = pattern_spectrum(position, weight / self._scale, wavenumber, step, rows)
        self.values = np.ascontiguousarray(values[:, self.used] * (roll / self.spectrum ** 2).astype(np.float32))

    def own_noise(self) -> np.ndarray:
        """Give the power of white noise of variance 1 at every element, read from rows at the ν used: (F, U) [-]."""
        position, *line = self._line
        power = pattern_spectrum(position, np.abs(self._weight / self._scale) ** 2, self._wavenumber, *line).real
        power = np.maximum(power, 0)
        level = np.sum(np.abs(self._weight / self._scale) ** 2)
        power *= level / power.mean(axis=1, keepdims=True)
        return power[:, self.used] / (self.spectrum ** 2).astype(np.float32)


def pattern_spectrum(position: np.ndarray, weight: np.ndarray, wavenumber: np.ndarray, step: float,
                     rows: int) -> np.ndarray:
    """Give Ŵ of (1), complex64 (F, rows), for weights (E,) as they are.

    Parameters
    ----------
    position : (E,) [m]
    weight : complex (E,)
    wavenumber : (F,) [1/m]
    step : float [-]
    rows : int
    """
    alive = weight != 0
    position, weight = position[alive], weight[alive].astype(np.complex64)
    above = -(-rows // BELOW)
    first = -(above * BELOW // 2) // BELOW * BELOW                       # m of a = 0, b = 0
    place = np.arange(first, first + above * BELOW + BELOW)
    chosen = (place >= -(rows // 2)) & (place < rows - rows // 2)
    fading = np.clip(2 * (np.abs(place[chosen]) - 0.5 * (rows - FADE)) / FADE, 0, 1)
    taper = np.cos(0.5 * np.pi * fading).astype(np.float32) ** 2
    spectrum = np.empty((len(wavenumber), rows), np.complex64)
    for begin in range(0, len(wavenumber), block := max(1, BLOCK // (len(position) * (above + BELOW + 1)))):
        part = slice(begin, begin + block)
        theta = np.multiply.outer(wavenumber[part] * step, position)     # (F, E)
        low = _powers(theta, BELOW) * weight[:, None]
        high = _powers(theta * BELOW, above + 1) * np.exp(-2j * np.pi * first * theta)[..., None].astype(np.complex64)
        pattern = (np.swapaxes(high, 1, 2) @ low).reshape(len(theta), -1)[:, chosen]
        spectrum[part] = fft.fft(fft.ifftshift(pattern * taper, axes=1), axis=1, overwrite_x=True)
    return spectrum


def _powers(theta: np.ndarray, count: int) -> np.ndarray:
    """Powers 0 ... count - 1 of exp(-2πi θ), complex64 (..., count), each a product of few others."""
    powers = np.ones((*theta.shape, count), np.complex64)
    have = 1
    while have < count:
        more = min(have, count - have)
        turn = np.exp(-2j * np.pi * have * theta)[..., None].astype(np.complex64)
        np.multiply(powers[..., :more], turn, out=powers[..., have:have + more])
        have += more
    return powers
