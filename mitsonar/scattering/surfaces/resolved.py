"""Lobe of the roughness that a mesh does not resolve: larger features are in the mesh and must not count twice.

    J = ∫_0^∞ J0(ΔK r) exp(-ΔK_z² D(r) / 2) r dr,    D(r) = 2 h² Φ(K_c r),    h² = 2π w2 K_c^(2 - γ) / (γ - 2)
    Φ(x) = (γ - 2) ∫_1^∞ u^(1 - γ) [1 - J0(u x)] du,    factor of the lobe: k² J / (8π s²)          (see small_slope)

The spectrum ends at K_c = 0.7 π / d below, d the distance of the mesh's nodes -> ``mesh_resolution``: flat facets on
nodes of a surface of that spectrum have the slopes of features up to K_c, and follow shorter features in part. D
saturates at 2 h², which leaves three parts, with κ = ΔK / K_c and m = ΔK_z² h²:

    K_c² J = e^(-m) g(κ) + m e^(-m) (γ - 2) κ^(-γ) [κ > 1] + R(κ, m)

a mirror reflection, single scattering by the remaining features, and a smooth rest R. The mirror reflection is spread
over a Gaussian of ΔK of variance 0.03 ΔK_z² <slope²>/2, with the slope of the features in the mesh: wide enough that
many facets contribute, and narrow against the spread by those facets. R is tabulated for one γ as its ratio to the same
integral without a cut (Hankel transforms on logarithmic grids). First order does not conserve energy strictly: at 3 to
10 degrees of incidence, below the critical angle, up to 1.23 times the incident energy may be scattered (sandy gravel
without its features over 15 cm, 100 kHz; sands 1.1).
"""
from collections.abc import Callable
from functools import lru_cache
from types import ModuleType

import numpy as np
import scipy

from mitsonar.device.types import Numbers

from .rough_interface import log_lobe
from .small_slope import MOST, SMALLEST, log_roughness

FACETS = 0.7                       # of the highest wavenumber on the nodes: features that facets follow
MIRROR = 0.03
POINTS = 1 << 14                   # of the transforms
FARTHEST = 2e3                     # x where Φ is 1 to 1e-6
STEP = 0.1                         # of the table, in ln m and in ln of κ over the lobe's width
LOW_M, HIGH_M = -9.0, 12.0         # ln m
LOW_T, HIGH_T = -3.5, 4.5          # ln (κ / width); the lobe is flat below, the ratio 1 - e^(-m) above
SIZE_M, SIZE_T = (round((high - low) / STEP) + 1 for low, high in ((LOW_M, HIGH_M), (LOW_T, HIGH_T)))


def cut(mesh_resolution: Numbers) -> Numbers:
    """Return K_c [rad/m] of a mesh by the distance of its nodes [m]."""
    return FACETS * np.pi / mesh_resolution


def resolved_factor(module: ModuleType, log_lobe: Callable[[Numbers, Numbers], Numbers],
                    log_ratio: Callable[[Numbers, Numbers], Numbers], shift: Numbers, shift_z: Numbers,
                    wavenumber: Numbers, w2: Numbers, gamma: Numbers, cut: Numbers) -> Numbers:
    """Return σ_rough over |a|² [-] as `small_slope.lobe_factor` does, without features of wavenumbers below ``cut``."""
    # cut [rad/m]
    alpha = 0.5 * gamma - 1
    s = module.maximum(shift_z, SMALLEST)
    per_cut = module.log(wavenumber / cut)
    log_m = module.log(np.pi * w2 / alpha) - 2 * alpha * module.log(cut) + 2 * module.log(wavenumber * s)
    m = module.exp(module.minimum(log_m, MOST))
    log_kappa = 0.5 * module.log(shift + SMALLEST**2) + per_cut
    log_core = log_m + _log_structure(module, alpha)
    uncut = log_lobe(log_core - 2 * alpha * log_kappa, alpha) - log_core / alpha
    width = module.maximum(log_core, 0) / (2 * alpha)
    rest = module.exp(module.minimum(uncut + log_ratio(log_m, log_kappa - width), MOST))
    beyond_cut = module.minimum(module.maximum(1e6 * log_kappa, 0), 1)
    single = beyond_cut * (gamma - 2) * m * module.exp(-m - gamma * module.maximum(log_kappa, 0))
    # <slope²>/2 = h² K_c² α / (4 - γ)
    variance = module.maximum(MIRROR * m * alpha / (4 - gamma), SMALLEST)
    square = module.exp(module.minimum(2 * log_kappa, MOST / 2))
    mirror = module.exp(-m - module.minimum(square / (2 * variance), MOST)) / variance
    return (mirror + single + rest) * module.exp(2 * per_cut) / (8 * np.pi * s * s)


def log_ratio(gamma: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return the NumPy look-up of ln of the ratio that `resolved_factor` needs."""
    table = ratio_table(gamma).astype(float)

    def look_up(log_m: np.ndarray, log_width: np.ndarray) -> np.ndarray:
        place = np.broadcast_arrays((log_m - LOW_M) / STEP, (log_width - LOW_T) / STEP)
        from scipy.ndimage import map_coordinates

        found = map_coordinates(table, [axis.ravel() for axis in place], order=1, mode="nearest")
        return found.reshape(place[0].shape) + np.minimum(log_m - LOW_M, 0)

    return look_up


def _log_structure(module: ModuleType, alpha: Numbers) -> Numbers:
    """Return ln c, with Φ = c x^2α for features of all sizes: C² r^2α = 2 h² c r^2α where K_c and w2 are 1."""
    return log_roughness(module, 1.0, 1.0, alpha) - module.log(np.pi / alpha)


@lru_cache(maxsize=8)
def ratio_table(gamma: float) -> np.ndarray:
    """Return the table of ln of R over the integral without a cut, float32 (SIZE_M, SIZE_T)."""
    alpha = 0.5 * gamma - 1
    log_x = np.linspace(-HIGH_M / (2 * alpha) - 12.0, np.log(FARTHEST), POINTS)
    x, step = np.exp(log_x), log_x[1] - log_x[0]
    left = _left(gamma, log_x)
    offset = scipy.fft.fhtoffset(step, mu=0)
    log_kappa = offset - 0.5 * (log_x[0] + log_x[-1]) + (np.arange(POINTS) - 0.5 * (POINTS - 1)) * step
    t = LOW_T + STEP * np.arange(SIZE_T)
    table = np.empty((SIZE_M, SIZE_T), np.float32)
    for row, log_m in enumerate(LOW_M + STEP * np.arange(SIZE_M)):
        m, log_core = np.exp(log_m), log_m + _log_structure(np, alpha)
        if m < 30:
            f = np.exp(-m) * (np.expm1(m * left) - m * left)
        else:
            f = np.exp(-m * (1 - left)) - np.exp(-m) * (1 + m * left)
        transform = scipy.fft.fht(x * f, step, mu=0, offset=offset) * np.exp(-log_kappa)
        at = t + max(log_core, 0) / (2 * alpha)
        found = np.interp(at, log_kappa, transform)
        uncut = log_lobe(log_core - 2 * alpha * at, alpha) - log_core / alpha
        table[row] = np.log(np.maximum(found, 1e-30)) - uncut
    return table


def _left(gamma: float, log_x: np.ndarray) -> np.ndarray:
    """Return 1 - Φ: by its series up to x = 3, beyond by its integral from the far end."""
    alpha, x = 0.5 * gamma - 1, np.exp(log_x)
    near = x < 3
    term, series = np.ones(near.sum()), np.zeros(near.sum())
    for n in range(1, 30):
        term = -term * (x[near] / (2 * n)) ** 2
        series += term * (gamma - 2) / (2 * n + 2 - gamma)
    left = np.empty_like(x)
    left[near] = 1 - np.exp(_log_structure(np, alpha)) * x[near] ** (2 * alpha) - series
    f = x[~near] ** (2 - gamma) * scipy.special.j0(x[~near])
    from scipy.interpolate import CubicSpline

    total = CubicSpline(log_x[~near], f).antiderivative()(log_x[~near])
    end = -x[-1] ** (1 - gamma) * scipy.special.j1(x[-1])
    left[~near] = (gamma - 2) * x[~near] ** (gamma - 2) * (total[-1] - total + end)
    return left
