"""Congruent cells of facets, for quadratures over them.

A facet (a, b, c) is cut into n² congruent triangles, n = ⌈longest side / cell size⌉. In barycentric coordinates
(u towards b, v towards c), row i = ⌊n u⌋ has 2 (n - i) - 1 cells, alternately upright and upside down. Cell numbers are

    s = i (2 n - i) + 2 j + k,    j = ⌊n v⌋,    k = 1 where frac(n u) + frac(n v) > 1,    s = 0 .. n² - 1
"""
from __future__ import annotations

from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.device.types import Float64, UInt32


def four_wide(rows: np.ndarray) -> np.ndarray:
    """Return rows of three with a zero appended, so that each row is one aligned packet on the device."""
    return np.concatenate([rows, np.zeros((*rows.shape[:-1], 1))], -1)


def divisions(longest_side: np.ndarray, cell_size: float | np.ndarray) -> np.ndarray:
    """Return n, uint32 (F,), for facets with these longest sides [m] (F,) and cells of at most `cell_size` [m]."""
    if np.ndim(cell_size) == 0 and np.isinf(cell_size):
        return np.broadcast_to(np.uint32(1), len(longest_side))
    return np.maximum(1, np.ceil(np.asarray(longest_side, float) / cell_size - 1e-9)).astype(np.uint32)


def place(lib: ModuleType, s: UInt32, n: UInt32, a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """Return barycentric coordinates (u, v) of the point (a, b) of the unit square, folded uniformly into cell s."""
    F, U = lib.Float64, lib.UInt32
    i = U(F(n) - dr.sqrt(F(n) * F(n) - F(s)))
    # rounding may carry the root across an integer
    i = dr.select(i * (2 * n - i) > s, i - 1, i)
    i = dr.select((i + 1) * (2 * n - (i + 1)) <= s, i + 1, i)
    rest = s - i * (2 * n - i)
    j, upside_down = rest >> 1, (rest & 1) != 0
    fold = a + b > 1
    a, b = dr.select(fold, 1 - a, a), dr.select(fold, 1 - b, b)
    a, b = dr.select(upside_down, 1 - a, a), dr.select(upside_down, 1 - b, b)
    return (F(i) + F(a)) / F(n), (F(j) + F(b)) / F(n)
