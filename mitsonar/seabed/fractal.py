"""Rough seabed, synthesised from its roughness spectrum.

    height = inverse FFT of  sqrt(W(K) (2 pi)^2 / (dx dy)) * FFT of white noise of unit variance

W -> ``spectrum`` [m^4], dx, dy -> steps of the grid [m]: the height variance of the grid is the integral of W over the
wavenumbers of the grid.

For a bed surveyed every D metres and interpolated to the finer grid by cubic splines, only the missing part of the
spectrum is added, W (1 - T^2). T is the response of the splines to a wave, near 1 below the survey's highest wavenumber
and near 0 above,

    T = t(kx Dx) t(ky Dy),   t(p) = sinc(p / 2)^4 / (2/3 + cos(p) / 3)          (Unser 1999, cardinal cubic spline)
"""
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from .relief import Relief, step
from .roughness import RoughnessSpectrum

_TILE = 256  # nodes; seed and position of a tile determine its noise
_MOST_NODES = 2**26
_SPLINE_REACH = 16  # nodes of a survey: correlation length of the added relief


@dataclass(frozen=True, kw_only=True)
class Fractal(Relief):
    """Realisation of a Gaussian rough surface.

    The noise belongs to the absolute node (x/dx, y/dy), and the grid is padded by one outer scale on all sides. The
    surface therefore does not repeat at the edges, and overlapping grids of the same step agree to about 0.1 % of the
    height. Another step gives another realisation. The mean over few outer scales is not zero, as over a patch of a
    real seabed.
    """

    spectrum: RoughnessSpectrum
    seed: int = 0  # the same seed and grid step give the same surface
    surveyed: tuple[float, float] | None = None  # [m]: steps Dx, Dy of a survey, below which relief is added

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights (Y, X) [m]; `ValueError` if the padded grid has too many nodes."""
        steps = step("y", np.asarray(y)), step("x", np.asarray(x))
        reach = self.spectrum.outer_scale if self.surveyed is None else min(
            self.spectrum.outer_scale, _SPLINE_REACH * max(self.surveyed))
        margin = [int(np.ceil(reach / d)) for d in steps]
        padded: list[Any] = [scipy.fft.next_fast_len(len(axis) + 2 * m, real=True) for axis, m in zip((y, x), margin)]
        if padded[0] * padded[1] > _MOST_NODES:
            raise ValueError(f"fractal: waves of up to {reach} m around {len(y)} x {len(x)} nodes "
                             f"at {steps[1]:.3g} m need {padded[0]} x {padded[1]} nodes, more than {_MOST_NODES}; "
                             "use a coarser step, a smaller grid or a smaller outer scale.")
        first = [round(axis[0] / d) - m for axis, d, m in zip((y, x), steps, margin)]
        noise = _white_noise(self.seed, first, padded)
        k_y = 2 * np.pi * scipy.fft.fftfreq(padded[0], steps[0])
        k_x = 2 * np.pi * scipy.fft.rfftfreq(padded[1], steps[1])
        gain = np.sqrt(self.spectrum.at(np.hypot(k_x, k_y[:, None])) * (2 * np.pi) ** 2 / (steps[0] * steps[1]))
        if self.surveyed is not None:
            t_x, t_y = _spline_response(k_x * self.surveyed[0]), _spline_response(k_y * self.surveyed[1])
            gain *= np.sqrt(np.maximum(1 - np.square(t_x * t_y[:, None]), 0))
        heights = np.asarray(scipy.fft.irfft2(scipy.fft.rfft2(noise) * gain, s=padded, overwrite_x=True))
        return heights[margin[0]:margin[0] + len(y), margin[1]:margin[1] + len(x)].copy()


def _spline_response(phase: np.ndarray) -> np.ndarray:
    """Return the gain of cubic-spline interpolation for waves of ``phase`` [rad] per node."""
    return np.sinc(phase / (2 * np.pi)) ** 4 / (2 / 3 + np.cos(phase) / 3)


def _white_noise(seed: int, first: list[int], shape: list[int]) -> np.ndarray:
    """Return standard normal noise for nodes from ``first`` (row, column) on."""
    noise = np.empty(shape)
    tiles = [range(start // _TILE, (start + count - 1) // _TILE + 1) for start, count in zip(first, shape)]
    for row in tiles[0]:
        for column in tiles[1]:
            generator = np.random.default_rng([seed, _natural(row), _natural(column)])
            tile = generator.standard_normal((_TILE, _TILE))
            (to_y, from_y), (to_x, from_x) = (_overlap(index, start, count)
                                              for index, start, count in zip((row, column), first, shape))
            noise[to_y, to_x] = tile[from_y, from_x]
    return noise


def _overlap(tile: int, start: int, count: int) -> tuple[slice, slice]:
    low, high = max(tile * _TILE, start), min((tile + 1) * _TILE, start + count)
    return slice(low - start, high - start), slice(low - tile * _TILE, high - tile * _TILE)


def _natural(integer: int) -> int:
    return integer + 2**40  # seeds must not be negative; no grid reaches this offset
