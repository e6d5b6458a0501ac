"""Smooth fields on a regular grid: a tilted plane, and what bends it, of a known deviation and length.

    h(x, y) = a + s_x x + s_y y + C q(k) z,    q ∝ (1 + ℓ²k²)^-1

C -> the cosine basis, whose functions are level across the grid's edges; z -> unknowns of deviation 1; q is such that
the mean deviation over the grid is ``deviation``; ℓ -> ``length``. Its constant is left out: a stands for it.
(Whittle 1954, Biometrika 41, 434: this prior.) Its power falls by k⁻⁴. That of seabeds falls by k⁻³ to k⁻⁴ (Jackson and
Richardson 2007, ch. 6): a prior that falls faster holds an answer off from them.
"""
from __future__ import annotations

import numpy as np
from scipy.fft import dctn, idctn


class SmoothField:
    """A prior over fields."""
    # spacing [m]; length [m]; slope [1/m]

    plane = 3

    def __init__(self, shape: tuple[int, int], spacing: tuple[float, float], *, deviation: float, length: float,
                 level: float, slope: float):
        if not (deviation > 0 and length > 0 and level > 0 and slope > 0):
            raise ValueError(f"a prior's deviation is {deviation:g}, its length {length:g}, those of its plane "
                             f"{level:g} and {slope:g}; give numbers above 0")
        wave = [np.pi * np.arange(count) / (count * step) for count, step in zip(shape, spacing)]
        share = (1 + length ** 2 * (wave[0][:, None] ** 2 + wave[1][None] ** 2)) ** -1.0
        share[0, 0] = 0
        self._share = share * deviation / np.sqrt(np.mean(share ** 2))
        at = [step * (np.arange(count) - (count - 1) / 2) for count, step in zip(shape, spacing)]
        self._plane = np.stack([np.full(shape, level), slope * at[0][:, None] + np.zeros(shape),
                                slope * at[1][None] + np.zeros(shape)])
        self.shape, self.size = shape, 3 + share.size

    def of(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the field (shape) of unknowns (size,)."""
        waves = idctn(unknowns[3:].reshape(self.shape) * self._share, norm="ortho")
        return waves + np.tensordot(unknowns[:3], self._plane, 1)

    def transposed(self, field: np.ndarray) -> np.ndarray:
        """The transpose of `of`."""
        waves = dctn(field, norm="ortho") * self._share
        return np.concatenate([(self._plane * field).sum((1, 2)), waves.ravel()])

    def prior_deviation(self) -> np.ndarray:
        """Deviation (shape) of the field beforehand."""
        waves = self._share ** 2
        number = [np.arange(count) for count in self.shape]
        basis = [np.cos(np.pi * np.outer(n + 0.5, n) / len(n)) ** 2 * np.where(n == 0, 1, 2) / len(n) for n in number]
        return np.sqrt(basis[0] @ waves @ basis[1].T + (self._plane ** 2).sum(0))


def grid_of(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the regular grid that vertices (N, 3) stand on in the plane."""
    # -> x [m], y [m]
    x, column = np.unique(np.round(positions[:, 0], 3), return_inverse=True)
    y, row = np.unique(np.round(positions[:, 1], 3), return_inverse=True)
    steps = [np.diff(axis) for axis in (x, y)]
    if len(x) * len(y) != len(positions) or min(len(x), len(y)) < 3 or any(np.ptp(d) > 0.02 * d.mean() for d in steps):
        raise ValueError(f"the {len(positions)} vertices stand on no regular grid along x and y; give the key of a "
                         "seabed or bathymetry that is not turned")
    number = np.full((len(x), len(y)), -1)
    number[column, row] = np.arange(len(positions))
    if np.any(number < 0):
        raise ValueError("two vertices stand on one place of the grid; give a bed of one height everywhere")
    return x, y, number
