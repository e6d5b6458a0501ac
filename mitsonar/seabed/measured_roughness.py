"""Roughness spectrum of a surveyed bed, to extrapolate it below the survey's resolution.

    P(k) = |FFT(window * (height - plane))|^2 dx dy / ((2 pi)^2 sum of window^2)      [m^4], mean of patches
    ln P(K) = ln(w2 K^-gamma + n)                                                   n: white noise of the soundings

Hann windows in both directions keep the much stronger long waves from leaking into the short ones. The fit uses K from
the fourth mode of a patch, below which the plane removes part of the power, to 0.6 of the highest wavenumber of the
grid, above which averaging and interpolation of the grid remove power, and aliased short waves add power.
"""
from collections.abc import Sequence

import numpy as np

from .roughness import RoughnessSpectrum

SMALLEST_PATCH = 32                 # nodes along a side
FIRST_MODE, HIGHEST = 4, 0.6        # of a patch; of the grid's highest wavenumber
GAMMAS = 2.05, 3.95                 # limits of the exponent
_OUTER_SCALE = 1e6                  # [m]: larger than any survey


def radial_spectrum(patches: Sequence[np.ndarray],
                    steps: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the mean spectrum of patches (N, N) [m] in rings of wavenumber.

    The results (K,) are wavenumber [rad/m], power [m^4] and the number of modes in each ring.
    """
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
    """Fit a power law plus white noise to the spectrum of patches of a bed.

    For 16 patches of 64 x 64 nodes, the exponent is right within 0.2 and the spectrum at the grid's highest wavenumber
    within 1.5 dB (``tests/seabed/test_measured_roughness.py``). Exponents beyond `GAMMAS` are clipped.
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
    fit = least_squares(misfit, (np.interp(middle, wavenumber, level), np.mean(exponents), level.min() - 4),
                        bounds=tuple(zip((level.min() - 20, level.max() + 20), exponents,
                                         (level.min() - 20, level.min() + 1))), x_scale=(1, 0.3, 1))
    strength, exponent, _ = fit.x
    exponent = float(np.clip(exponent, *GAMMAS) if gamma is None else gamma)
    return RoughnessSpectrum(w2=float(np.exp(strength) * middle**exponent), gamma=exponent, outer_scale=_OUTER_SCALE)
