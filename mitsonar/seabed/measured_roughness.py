"""Roughness spectrum measured on a surveyed bed, so that it can be continued below the survey's resolution.

    P(k) = |FFT(window * (height - plane))|^2 dx dy / ((2 pi)^2 sum of window^2)      [m^4], mean of patches
    ln P(K) = ln(w2 K^-gamma + n)                                                   n: white noise of the soundings

Windows (Hann in both directions) keep the long waves, far stronger, from leaking into the short ones. Fitted is K from
the fourth mode of a patch, below which the plane takes part of the power, to 0.6 of the highest wavenumber of the
grid: above, averaging and interpolation by those who made the grid take power away, and waves too short for it add to
it.
"""
from collections.abc import Sequence

import numpy as np

from .roughness import RoughnessSpectrum

SMALLEST_PATCH = 32                 # nodes along a side
FIRST_MODE, HIGHEST = 4, 0.6        # of a patch; of the grid's highest wavenumber
GAMMAS = 2.05, 3.95                 # between those that a spectrum may have
_OUTER_SCALE = 1e6                  # [m]: no levelling off within any survey


def radial_spectrum(patches: Sequence[np.ndarray],
                    steps: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measure the spectrum of a bed by the mean of its patches, in rings of wavenumber."""
    # patches (N, N) [m]; steps [m] -> wavenumber (K,) [rad/m], power (K,) [m^4], modes of a ring (K,)
    size = patches[0].shape[0]
    window = np.hanning(size + 1)[:-1]
    window = np.outer(window, window)
    row, column = np.mgrid[:size, :size] / size - 0.5
    base = np.column_stack((np.ones(size * size), row.ravel(), column.ravel()))
    total = np.zeros((size, size))
    for patch in patches:
        heights = np.ravel(patch).astype(np.float64)
        heights -= base @ np.linalg.lstsq(base, heights, rcond=None)[0]
        total += np.abs(np.fft.fft2(heights.reshape(size, size) * window)) ** 2
    total *= steps[0] * steps[1] / ((2 * np.pi) ** 2 * (window**2).sum() * len(patches))
    k = np.hypot(*np.meshgrid(*(2 * np.pi * np.fft.fftfreq(size, step) for step in steps)))
    ring = np.rint(k * size * max(steps) / (2 * np.pi)).astype(int).ravel()
    modes = np.bincount(ring)
    kept = modes > 0
    kept[0] = False
    wavenumber, power = (np.bincount(ring, values.ravel())[kept] / modes[kept] for values in (k, total))
    return wavenumber, power, modes[kept]


def fit_power_law(patches: Sequence[np.ndarray], steps: tuple[float, float],
                  gamma: float | None = None) -> RoughnessSpectrum:
    """Fit a power law, and white noise beside it, to the spectrum of patches of a bed.

    Of 16 patches of 64 x 64 nodes the exponent is right within 0.2 and the spectrum at the grid's highest wavenumber
    within 1.5 dB (``tests/seabed/test_measured_roughness.py``). Exponents beyond `GAMMAS` are set to the nearer end.
    """
    from scipy.optimize import least_squares

    wavenumber, power, modes = radial_spectrum(patches, steps)
    lowest = FIRST_MODE * 2 * np.pi / (len(patches[0]) * np.sqrt(steps[0] * steps[1]))
    used = (wavenumber >= lowest) & (wavenumber <= HIGHEST * np.pi / max(steps))
    wavenumber, power, weight = wavenumber[used], power[used], np.sqrt(modes[used])
    if not power.min() > 0:
        raise ValueError("the survey is level to the last digit and has no spectrum to continue.")
    middle = np.exp(np.mean(np.log(wavenumber)))
    exponents = GAMMAS if gamma is None else (gamma - 1e-9, gamma + 1e-9)

    def misfit(unknown):
        strength, exponent, noise = unknown
        law = np.exp(strength) * (wavenumber / middle) ** -exponent
        return weight * np.log((law + np.exp(noise)) / power)

    level = np.log(power)
    found = least_squares(misfit, (np.interp(middle, wavenumber, level), np.mean(exponents), level.min() - 4),
                          bounds=tuple(zip((level.min() - 20, level.max() + 20), exponents,
                                           (level.min() - 20, level.min() + 1))), x_scale=(1, 0.3, 1))
    strength, exponent, _ = found.x
    exponent = float(np.clip(exponent, *GAMMAS) if gamma is None else gamma)
    return RoughnessSpectrum(w2=float(np.exp(strength) * middle**exponent), gamma=exponent, outer_scale=_OUTER_SCALE)
