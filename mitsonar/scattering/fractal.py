"""Rough seabed synthesised from its roughness spectrum.

    height = inverse FFT of  sqrt(W(K) (2 pi)^2 / (dx dy)) * FFT of white noise of unit variance

W -> ``spectrum`` [m^4], dx, dy -> steps of the grid [m]: the height variance of the grid is then the integral of W over
the wavenumbers the grid can hold.
"""
from dataclasses import dataclass

import numpy as np
from scipy import fft

from .relief import Relief, step
from .roughness import RoughnessSpectrum

_TILE = 256  # nodes; the noise of a tile follows from the seed and the tile's place
_MOST_NODES = 2**26


@dataclass(frozen=True, kw_only=True)
class Fractal(Relief):
    """One realisation of a Gaussian rough surface.

    Parameters
    ----------
    spectrum : RoughnessSpectrum
    seed : int
        Realisation; the same seed and grid step give the same surface.

    Notes
    -----
    The noise belongs to the absolute node (x/dx, y/dy), and the grid is padded by one outer scale all round, so
    the surface neither repeats at the edges nor changes when the grid reaches further: two grids of the same step
    agree where they overlap to about 0.1 % of the height. Another step is another realisation. The mean over a grid
    of few outer scales is not zero, as over a patch of a real seabed.
    """

    spectrum: RoughnessSpectrum
    seed: int = 0

    def on_grid(self, x, y):
        """Give the heights (Y, X) [m]; raise `ValueError` if the outer scale spans too many nodes."""
        steps = step("y", np.asarray(y)), step("x", np.asarray(x))
        margin = [int(np.ceil(self.spectrum.outer_scale / d)) for d in steps]
        padded = [fft.next_fast_len(len(axis) + 2 * m, real=True) for axis, m in zip((y, x), margin)]
        if padded[0] * padded[1] > _MOST_NODES:
            raise ValueError(f"fractal: outer scale {self.spectrum.outer_scale} m about {len(y)} x {len(x)} nodes "
                             f"at {steps[1]:.3g} m needs {padded[0]} x {padded[1]} nodes, more than {_MOST_NODES}; "
                             "use a coarser step, a smaller grid or a smaller outer scale.")
        first = [round(axis[0] / d) - m for axis, d, m in zip((y, x), steps, margin)]
        noise = _white_noise(self.seed, first, padded)
        k_y = 2 * np.pi * fft.fftfreq(padded[0], steps[0])
        k_x = 2 * np.pi * fft.rfftfreq(padded[1], steps[1])
        gain = np.sqrt(self.spectrum.at(np.hypot(k_x, k_y[:, None])) * (2 * np.pi) ** 2 / (steps[0] * steps[1]))
        heights = fft.irfft2(fft.rfft2(noise) * gain, s=padded, overwrite_x=True)
        return heights[margin[0]:margin[0] + len(y), margin[1]:margin[1] + len(x)].copy()


def _white_noise(seed, first, shape):
    """Give the unit normal noise of the nodes from ``first`` (row, column) on."""
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


def _overlap(tile, start, count):
    low, high = max(tile * _TILE, start), min((tile + 1) * _TILE, start + count)
    return slice(low - start, high - start), slice(low - tile * _TILE, high - tile * _TILE)


def _natural(integer):
    return integer + 2**40  # seeds must not be negative: an offset no grid reaches
