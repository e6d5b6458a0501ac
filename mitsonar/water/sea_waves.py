"""Waves of the sea surface: spectra, and the way of the surface's water in time, by linear theory in deep water.

    S(f) = 5/16 H² f_p⁴ f⁻⁵ e^(-5/4 (f_p/f)⁴)                 `pierson_moskowitz` (1964), a sea that the wind has raised
    S(f) ∝ the same · γ^b,  b = e^(-(f/f_p - 1)²/2σ²),  σ = 0.07 below f_p, 0.09 above        `jonswap`: Hasselmann and
                                                                others (1973), a sea that still grows
    D(θ) ∝ cos^2s(θ/2)                                         spreading (Longuet-Higgins, Cartwright and Smith, 1963)

H -> significant height [m], 4 √(∫ S df); f_p -> frequency of the peak [Hz]; γ -> ``enhancement``; s -> ``spreading``.
Developed by a wind U at 10 m: g / (2π f_p U') = 1/0.877, H = 0.21 U'²/g, U' = 1.026 U at 19.5 m.

A piece of water that rests at x moves on an ellipse, which in deep water is a circle,

    D(x, t) = Σ_j a_j (-k̂_j sin ψ_j, cos ψ_j),    ψ_j = k_j·x - ω_j t + φ_j,    ω_j² = g |k_j|

N components j stand for N parts of the spectrum, as many for its energy as for its slopes: a_j²/2 is the energy of the
part, ω_j⁴ its mean weighted by energy, so that variance and mean square slope are those of S, whatever N. Directions
and phases φ_j are drawn by the seed.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

GRAVITY = 9.81                     # [m/s²]
COMPONENTS = 256
STEEPEST = 1 / 15                  # H over the peak's wavelength, of periods to 8 s: DNV-RP-C205 (2010), section 3.5
ROUGHEST = 0.12                    # mean square slope; 0.09 in a gale, of all waves (Cox and Munk, 1954)
USUAL_STEEPNESS = 0.04             # of a developed sea
LOWEST = 0.4                       # of the peak's frequency, below which a model has no waves
HIGHEST = 30.0                     # of the peak's frequency, above which it has none
STREAM = 0x5EA                     # of chance
_FINE = 20001                      # frequencies that integrals run over
_AT_ONCE = 1 << 20                 # cosines of a block


class DevelopedSea(NamedTuple):
    """Sea that a wind has raised in the end."""

    height: float                  # [m]: significant
    period: float                  # [s]: of the peak


def developed_sea(wind_speed: float) -> DevelopedSea:
    """Return height and period of the sea that a wind [m/s] at 10 m raises in the end; Pierson and Moskowitz (1964)."""
    wind = 1.026 * float(wind_speed)
    return DevelopedSea(0.21 * wind**2 / GRAVITY, 2 * np.pi * wind / (0.877 * GRAVITY))


def wavelength(period: float) -> float:
    """Return the length [m] of deep-water waves of a period [s]."""
    return GRAVITY * period**2 / (2 * np.pi)


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveSpectrum:
    """Density of the surface's variance over frequency, and its spread over directions."""

    frequency: np.ndarray  # (F,) [Hz], rising
    density: np.ndarray  # (F,) [m²/Hz]
    heading: float = 0.0  # [rad]: towards which the waves travel, clockwise from north
    spreading: float = 10.0  # s

    def __post_init__(self) -> None:
        f, s = self.frequency, self.density
        if f.shape != s.shape or f.ndim != 1 or len(f) < 2:
            raise ValueError(f"a wave spectrum has {f.shape} frequencies and {s.shape} densities; give two or more of "
                             "each")
        if not (np.isfinite(f).all() and np.isfinite(s).all() and f[0] > 0 and np.all(np.diff(f) > 0)):
            raise ValueError("the frequencies of a wave spectrum must be above 0 Hz and rise from row to row, and all "
                             "numbers be finite; sort the rows and leave out the frequency 0")
        if s.min() < 0 or not s.max() > 0:
            raise ValueError("the densities of a wave spectrum must be 0 or more [m²/Hz], and one of them more than 0; "
                             "correct the column")
        if self.steepness > STEEPEST:
            raise ValueError(f"waves {self.height:.3g} m high whose peak has a period of {self.peak_period:.3g} s are "
                             f"steeper than a sea can be: 1/{1 / self.steepness:.3g} of their length, at most "
                             f"1/{1 / STEEPEST:.0f}; give lower or longer waves")

    @classmethod
    def model(cls, height: float, period: float, *, enhancement: float = 1.0, heading: float = 0.0,
              spreading: float = 10.0) -> WaveSpectrum:
        """Return the spectrum of a significant height [m] and a peak's period [s]; enhancement 1: Pierson-Moskowitz."""
        x = np.geomspace(LOWEST, HIGHEST, _FINE)
        density = x**-5 * np.exp(-1.25 * x**-4)
        density *= enhancement ** np.exp(-0.5 * ((x - 1) / np.where(x < 1, 0.07, 0.09)) ** 2)
        density *= height**2 / 16 / (np.trapezoid(density, x) / period)
        return cls(frequency=x / period, density=density, heading=heading, spreading=spreading)

    @cached_property
    def _fine(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frequencies (_FINE - 1,) [Hz], variances [m²] and mean square slopes of narrow bands."""
        edge = np.geomspace(self.frequency[0], self.frequency[-1], _FINE)
        f = np.sqrt(edge[1:] * edge[:-1])
        variance = np.interp(f, self.frequency, self.density) * np.diff(edge)
        return f, variance, variance * ((2 * np.pi * f) ** 2 / GRAVITY) ** 2

    def variance(self, shortest: float = 0.0) -> float:
        """Return the variance of heights [m²], of waves longer than `shortest` [m]."""
        f, variance, _ = self._fine
        return float(variance[f <= cut_frequency(shortest)].sum())

    def slope_variance(self, shortest: float = 0.0) -> float:
        """Return the mean square slope, of both components together, of waves longer than `shortest` [m]."""
        f, _, slope = self._fine
        return float(slope[f <= cut_frequency(shortest)].sum())

    @property
    def height(self) -> float:
        """Return the significant height [m]."""
        return 4 * self.variance() ** 0.5

    @property
    def peak_period(self) -> float:
        """Return the period of the peak [s]."""
        return float(1 / self.frequency[np.argmax(self.density)])

    @property
    def steepness(self) -> float:
        """Return the significant height over the wavelength of the peak."""
        return self.height / wavelength(self.peak_period)

    def waves(self, seed: int = 0, *, shortest: float = 0.0, components: int = COMPONENTS) -> SeaWaves:
        """Return waves longer than `shortest` [m] that have this spectrum; raise `ValueError` if there are none."""
        f, variance, slope = (part[self._fine[0] <= cut_frequency(shortest)] for part in self._fine)
        if not len(f) or not variance.sum() > 0:
            raise ValueError(f"no wave of the spectrum is longer than {shortest:.3g} m; give longer waves, or a "
                             "smaller size of the surface, whose mesh then has shorter ones")
        if slope.sum() > ROUGHEST:
            raise ValueError(f"the waves longer than {shortest:.3g} m have a mean square slope of {slope.sum():.2g} "
                             f"and would break; give at most {ROUGHEST:g}, that is, lower densities at the "
                             "highest frequencies")
        share = np.cumsum(0.5 * variance / variance.sum() + 0.5 * slope / slope.sum())
        part = np.minimum((components * share / share[-1] * (1 - 1e-12)).astype(int), components - 1)
        total, steep = (np.bincount(part, weight, components) for weight in (variance, slope))
        kept = total > 0
        rng = np.random.default_rng([seed, STREAM])
        # even over the spread, in an order that has nothing to do with frequency
        turn = (rng.permutation(components) + rng.random(components)) / components
        return SeaWaves(amplitude=np.sqrt(2 * total[kept]),
                        wavenumber=np.sqrt(steep[kept] / total[kept]),
                        heading=(self.heading + self._spread(turn))[kept],
                        phase=rng.uniform(0, 2 * np.pi, components)[kept])

    def _spread(self, share: np.ndarray) -> np.ndarray:
        """Return the angles [rad] from the mean heading below which shares of the energy travel."""
        angle = np.linspace(-np.pi, np.pi, 4001)
        density = np.cos(angle / 2) ** 2
        below = np.cumsum(density**self.spreading)
        return np.interp(share, (below - below[0]) / (below[-1] - below[0]), angle)


def cut_frequency(shortest: float) -> float:
    """Return the frequency [Hz] of waves of a length [m], the highest of all longer ones."""
    return np.sqrt(GRAVITY / (2 * np.pi * shortest)) if shortest > 0 else np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaWaves:
    """Waves as a sum of sinusoids."""

    amplitude: np.ndarray  # (N,) [m]: a
    wavenumber: np.ndarray  # (N,) [rad/m]: |k|
    heading: np.ndarray  # (N,) [rad]: of travel, clockwise from north
    phase: np.ndarray  # (N,) [rad]: φ

    @cached_property
    def vector(self) -> np.ndarray:
        """Return k, (N, 2) [rad/m], east and north."""
        return self.wavenumber[:, None] * np.stack([np.sin(self.heading), np.cos(self.heading)], 1)

    @cached_property
    def rate(self) -> np.ndarray:
        """Return ω, (N,) [rad/s]."""
        return np.sqrt(GRAVITY * self.wavenumber)

    @property
    def variance(self) -> float:
        """Return the variance of heights [m²]."""
        return float(0.5 * np.sum(self.amplitude**2))

    @property
    def slope_variance(self) -> float:
        """Return the mean square slope, of both components together."""
        return float(0.5 * np.sum((self.amplitude * self.wavenumber) ** 2))

    @property
    def crest(self) -> float:
        """Return a height [m] that no crest of a survey reaches, six standard deviations."""
        return 6 * self.variance**0.5

    def displaced(self, place: ArrayLike, time: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return displacement D (..., 3) [m], z up, and velocity (..., 3) [m/s] of water that rests at places."""
        # place (..., 2) [m], time (...) [s]
        x = np.asarray(place, float)
        t = np.broadcast_to(np.asarray(time, float), x.shape[:-1]).ravel()
        x = x.reshape(-1, 2)
        moved, velocity = np.empty((len(x), 3)), np.empty((len(x), 3))
        towards = self.vector / self.wavenumber[:, None]
        step = max(1, _AT_ONCE // len(self.amplitude))
        for first in range(0, len(x), step):
            part = slice(first, first + step)
            psi = x[part] @ self.vector.T - t[part, None] * self.rate + self.phase
            sine, cosine = self.amplitude * np.sin(psi), self.amplitude * np.cos(psi)
            moved[part, :2], moved[part, 2] = -sine @ towards, cosine.sum(1)
            velocity[part, :2], velocity[part, 2] = (self.rate * cosine) @ towards, sine @ self.rate
        shape = (*np.shape(place)[:-1], 3)
        return moved.reshape(shape), velocity.reshape(shape)

    def height(self, place: ArrayLike, time: ArrayLike) -> np.ndarray:
        """Return heights (...) [m] of the surface, to first order in its slope, at places (..., 2) [m], times (...)."""
        return self.displaced(place, time)[0][..., 2]
