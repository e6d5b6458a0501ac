"""Exact scattering by spheres: the series over spherical waves.

    f(θ) = (i / k) Σ_n (2n + 1) A_n* P_n(cos θ),    A_n = -(j_n' - L_n j_n) / (h_n' - L_n h_n)          [m]

a -> ``radius`` [m], k = 2πf / c, θ -> ``angle`` between the directions of travel before and after; j, h, P_n spherical
Bessel and Hankel functions of ka and Legendre polynomials; L_n = p' / p of the n-th wave at the surface, by ka:

    rigid     0;   soft     ∞                         V. C. Anderson, 1950, J. Acoust. Soc. Am. 22, 426
    fluid     (ρ k_1 / ρ_1 k) j_n'(k_1 a) / j_n(k_1 a)                 the same; a shell joins two of them
    elastic   -(ρ / ρ_1) tan ζ_n / ka                 J. J. Faran, 1951, J. Acoust. Soc. Am. 23, 405, eq. 30

An incident pressure p at the centre scatters as p f e^(-ikr) / r for time e^(+iωt), the convention of `echoes.record`;
the front of a rigid sphere contributes (a/2) e^(2ika).
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

LARGEST_KA = 10_000.0
WATER_DENSITY = 1026.0             # [kg/m³]: default


@dataclass(frozen=True, kw_only=True)
class Solid:
    """Material of a sphere.

    Attributes
    ----------
    density : float [kg/m³]
    compressional_speed : float [m/s]
    shear_speed : float [m/s]
        0 for a fluid.
    """

    density: float
    compressional_speed: float
    shear_speed: float = 0.0

    def __post_init__(self):
        if not (0 < self.density < np.inf and 0 < self.compressional_speed < np.inf):
            raise ValueError(f"density and compressional speed of a sphere are {self.density:g} kg/m³ and "
                             f"{self.compressional_speed:g} m/s; give numbers above 0.")
        if not 0 <= self.shear_speed < np.sqrt(0.75) * self.compressional_speed:
            raise ValueError(f"shear waves of {self.shear_speed:g} m/s in a sphere with compressional waves of "
                             f"{self.compressional_speed:g} m/s; give one below 0.866 of that, as a positive modulus "
                             "of compression wants, or 0 for a fluid.")


# MacLennan and Dunn 1984 (J. Sound Vib. 97, 321); Foote 1982 (J. Acoust. Soc. Am. 71, 742); Kaye and Laby 1995
MATERIALS = {"tungsten_carbide": Solid(density=14900.0, compressional_speed=6853.0, shear_speed=4171.0),
             "copper": Solid(density=8947.0, compressional_speed=4760.0, shear_speed=2288.5),
             "aluminium": Solid(density=2700.0, compressional_speed=6420.0, shear_speed=3040.0),
             "steel": Solid(density=7900.0, compressional_speed=5940.0, shear_speed=3220.0)}


@dataclass(frozen=True, kw_only=True)
class SphereBody:
    """Composition of a sphere.

    Attributes
    ----------
    inside : {"rigid", "soft"} or Solid
    shell : Solid or None
        Fluid layer around `inside`.
    shell_thickness : float [m]
    """

    inside: Literal["rigid", "soft"] | Solid
    shell: Solid | None = None
    shell_thickness: float = 0.0

    def __post_init__(self):
        if not (isinstance(self.inside, Solid) or self.inside in ("rigid", "soft")):
            raise ValueError(f"a sphere is rigid, soft or a Solid, got {self.inside!r}.")
        if self.shell is not None and (self.shell.shear_speed or self.shell_thickness <= 0):
            raise ValueError("the shell of a sphere has a thickness above 0 and no shear waves; give those.")


def sphere_form(radius: float, frequency: ArrayLike, sound_speed: float = 1500.0, *, body: SphereBody,
                density: float = WATER_DENSITY, angle: ArrayLike = np.pi) -> np.ndarray:
    """Return the form function f of a sphere, with the phase of its centre.

    Parameters
    ----------
    radius : float [m]
        Outer radius, shell included.
    frequency : array [Hz]
    sound_speed, density : float [m/s], [kg/m³]
        Sound speed and density of the water.
    body : SphereBody
    angle : array [rad]
        Angle between the directions of travel: 0 forward, π back; broadcast with `frequency`.

    Returns
    -------
    complex array [m]
        Form function; 20 log |f| is the target strength.

    Raises
    ------
    ValueError
        If a frequency or the radius is not above 0, or ka above LARGEST_KA.

    Notes
    -----
    Omitted terms are below 1e-12. Near forward scattering the sum loses as many digits as cos θ.
    """
    frequency, angle = np.broadcast_arrays(np.asarray(frequency, float), np.asarray(angle, float))
    wavenumber = 2 * np.pi * frequency.ravel() / sound_speed
    every, which = np.unique(wavenumber, return_inverse=True)
    ka = every * radius
    if not (ka.size and np.all((ka > 0) & (ka <= LARGEST_KA))):
        raise ValueError(f"spheres are computed for ka above 0 and up to {LARGEST_KA:g}; give a radius and frequencies "
                         f"above 0 and a smaller sphere, got {radius:g} m and {np.max(frequency, initial=0):g} Hz.")
    waves = _waves(ka, body, radius, sound_speed, density)                                        # (n, frequency)
    total, cosine = np.zeros(len(wavenumber), complex), np.cos(angle.ravel())
    before, now = np.zeros_like(cosine), np.ones_like(cosine)
    for n, wave in enumerate(waves):
        total += (2 * n + 1) * np.conj(wave[which]) * now
        before, now = now, ((2 * n + 1) * cosine * now - n * before) / (n + 1)
    return (1j * total / wavenumber).reshape(frequency.shape)[()]


def _waves(ka: np.ndarray, body: SphereBody, radius: float, sound_speed: float, density: float) -> np.ndarray:
    """Return A_n, complex (n, frequency)."""
    highest = float(np.max(ka))
    n = np.arange(int(highest + 5 * np.cbrt(highest) + 10) + 1)[:, None]
    j, dj, y, dy = _bessel(n, ka)
    if body.inside == "soft" and body.shell is None:
        upper, lower = j, y
    else:
        slope = _slope(n, ka, body, radius, sound_speed, density)
        with np.errstate(over="ignore", invalid="ignore"):
            upper, lower = dj - slope * j, dy - slope * y
    with np.errstate(over="ignore", invalid="ignore"):
        lower = np.where(np.isfinite(lower), lower, 0)
        ratio = -upper / np.where(lower == 0, 1, upper + 1j * lower)
    return np.where(lower == 0, 0, ratio)


def _slope(n: np.ndarray, ka: np.ndarray, body: SphereBody, radius: float, sound_speed: float,
           density: float) -> np.ndarray | float:
    """Return L_n at the outer surface, with respect to ka."""
    inside = body.inside
    if body.shell is None:
        if isinstance(inside, str):
            return 0.0
        if inside.shear_speed:
            return _elastic_slope(n, ka, inside, sound_speed, density)
        ratio = sound_speed / inside.compressional_speed
        return density / inside.density * ratio * _log_slope(n, ratio * ka)
    shell = body.shell
    ratio = sound_speed / shell.compressional_speed
    outer, inner = ratio * ka, ratio * ka * (1 - body.shell_thickness / radius)
    # the shell's wave is j_n - B y_n, whose slope at the inner surface is that of the inside
    j, dj, y, dy = _bessel(n, inner)
    if inside == "soft":
        with np.errstate(invalid="ignore"):
            share = j / y
    else:
        within = SphereBody(inside=inside)
        slope = _slope(n, inner, within, radius, shell.compressional_speed, shell.density)
        with np.errstate(over="ignore", invalid="ignore"):
            share = (dj - slope * j) / (dy - slope * y)
    share = np.where(np.isfinite(share), share, 0)
    j, dj, y, dy = _bessel(n, outer)
    there = (share != 0) & np.isfinite(y) & np.isfinite(dy)
    y, dy = np.where(there, y, 0), np.where(there, dy, 0)
    bare = _log_slope(n, outer)
    with np.errstate(divide="ignore", invalid="ignore"):
        joined = np.where(there, (dj - share * dy) / (j - share * y), bare)
    return density / shell.density * ratio * joined


def _elastic_slope(n: np.ndarray, ka: np.ndarray, solid: Solid, sound_speed: float, density: float) -> np.ndarray:
    x1, x2 = (ka * sound_speed / speed for speed in (solid.compressional_speed, solid.shear_speed))
    a1, a2 = -x1 * _log_slope(n, x1), -x2 * _log_slope(n, x2)          # tan α_n
    square, half = n * (n + 1), 0.5 * x2 ** 2
    shear = square / (square - 1 - half + a2)
    tangent = -half * (a1 / (a1 + 1) - shear) / ((square - half + 2 * a1) / (a1 + 1) - shear * (a2 + 1))
    return -density / solid.density * tangent / ka


def _bessel(n: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return j_n, j_n', y_n, y_n' of x (F,), each (n, F); y is not finite where it overflows.

    Recurrence runs upwards; j of orders above x comes from its slope, as it decays there.
    """
    slope, last = _log_slope(n, x), len(n) - 1
    j, y = np.empty((last + 2, x.size)), np.empty((last + 2, x.size))
    j[0], y[0] = np.sin(x) / x, -np.cos(x) / x
    j[1], y[1] = (j[0] - np.cos(x)) / x, (y[0] - np.sin(x)) / x
    with np.errstate(over="ignore", invalid="ignore"):
        for order in range(1, last + 1):
            y[order + 1] = (2 * order + 1) / x * y[order] - y[order - 1]
            if order < last:
                falling = j[order] / ((order + 2) / x + slope[order + 1])
                j[order + 1] = np.where(order + 1 > x, falling, (2 * order + 1) / x * j[order] - j[order - 1])
        j, y = j[:last + 1], y[:last + 1]
        small = x < 1                  # here even the first upward step loses digits
        for order in range(1, last + 1):
            j[order] = np.where(small, j[order - 1] / ((order + 1) / x + slope[order]), j[order])
        dj = np.concatenate([-j[1:2], j[:-1] - (n[1:] + 1) / x * j[1:]])
        dy = np.concatenate([-y[1:2], y[:-1] - (n[1:] + 1) / x * y[1:]])
    # above x the difference loses its digits, and the slope has no poles
    return j, np.where(n > x, slope * j, dj), y, dy


def _log_slope(n: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return j_n'(x) / j_n(x) by downward recurrence, the only direction that keeps its digits."""
    last = int(n[-1, 0])
    slope = np.empty((last + 1, x.size))
    start = last + int(np.max(x)) + 50
    value = start / x
    for order in range(start, 0, -1):
        if order <= last:
            slope[order] = value
        value = (order - 1) / x - 1 / (value + (order + 1) / x)
    slope[0] = value
    return slope
