"""Scatterers: every facet of a scene is cut into cells, each with one fixed point and one complex Gaussian amplitude.

A facet (a, b, c) is cut into n² congruent triangles, n = ⌈longest side / cell size⌉. In barycentric coordinates
(u towards b, v towards c) row i = ⌊n u⌋ holds 2 (n - i) - 1 of them, by turns upright and upside down, so that

    s = i (2 n - i) + 2 j + k,    j = ⌊n v⌋,    k = 1 where frac(n u) + frac(n v) > 1

numbers them 0..n² - 1. The scatterer of a cell lies anywhere in it with equal chance and its amplitude g is circular
complex Gaussian, <|g|²> = 1: the pressure of an echo is g √(σ dA) times what the way does to it. Then the level of
many cells is σ times their area however they are cut. Amplitudes are Rayleigh where a resolution cell holds many; with
N on average the second moment of intensity is 2 (1 + 1/N), for their number varies. Place and amplitude are hashed
from (shape, facet, s) alone: every element, ping and run sees the same seabed.
"""
from __future__ import annotations

from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.device.types import DrJitArray, Float64, UInt32


def divisions(longest_side: np.ndarray, cell_size: float | np.ndarray) -> np.ndarray:
    """Return n for facets whose longest side [m] (F,) is cut to at most `cell_size` [m], as uint32 (F,)."""
    return np.maximum(1, np.ceil(np.asarray(longest_side, float) / cell_size - 1e-9)).astype(np.uint32)


def cell_of(lib: ModuleType, u: DrJitArray, v: DrJitArray, n: UInt32) -> UInt32:
    """Number s of the cell that holds barycentric coordinates (u, v), Float or Float64 (H,), of facets cut n-fold."""
    N = type(u)(n)
    i = dr.minimum(lib.UInt32(u * N), n - 1)
    j = dr.minimum(lib.UInt32(v * N), n - 1 - i)
    fraction = u * N - type(u)(i) + (v * N - type(u)(j))
    upside_down = (fraction > 1) & (i + j + 1 < n)
    return i * (2 * n - i) + 2 * j + dr.select(upside_down, lib.UInt32(1), lib.UInt32(0))


def place(lib: ModuleType, s: UInt32, n: UInt32, a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """Barycentric coordinates (u, v), Float64, of the point (a, b) in the unit square, folded into cell s.

    Uniform (a, b) give a uniform point of the cell.
    """
    F, U = lib.Float64, lib.UInt32
    i = U(F(n) - dr.sqrt(F(n) * F(n) - F(s)))
    # the root may be rounded across a whole number
    i = dr.select(i * (2 * n - i) > s, i - 1, i)
    i = dr.select((i + 1) * (2 * n - (i + 1)) <= s, i + 1, i)
    rest = s - i * (2 * n - i)
    j, upside_down = rest >> 1, (rest & 1) != 0
    fold = a + b > 1
    a, b = dr.select(fold, 1 - a, a), dr.select(fold, 1 - b, b)
    a, b = dr.select(upside_down, 1 - a, a), dr.select(upside_down, 1 - b, b)
    return (F(i) + F(a)) / F(n), (F(j) + F(b)) / F(n)
