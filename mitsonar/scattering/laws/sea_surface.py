"""Scattering by the wind-roughened sea surface, seen from below: bubbles, facets and ripples.

    σ = σ_b + [F σ_f + (1 - F) σ_c] 10^(-(SBL_i + SBL_s)/20)

    SBL = 1.26e-3 U^1.57 f^0.85 / sin θ [dB];           below U = 6 that of U = 6 times e^(1.2 (U - 6))
    σ_b = (δ_r/δ) β_v/4π {2 h(2 β_i + 2 β_s) + 2 (1 + γ) e^(-2 min(β_i, β_s)) h(2 |β_i - β_s|)},  h(y) = (1 - e^-y)/y
    σ_f = G e^(-t²/s²) (1 + t²)²/(4π s²),               s² = 4.6e-3 ln(2.1 U²)
    σ_c = 1.3e-5 U t^-4 [4 sin θ_i sin θ_s / (sin θ_i + sin θ_s)²]²,    0 where arctan t < 5 degrees
    F = 1/(1 + e^(0.524 (arctan t - arctan t_f))), in degrees,          (1 + t_f²)² e^(-t_f²/s²) = 10^-1.5

U -> ``wind_speed`` [m/s] at 10 m, f -> ``frequency`` (in kHz here), θ -> grazing angles; β = β_v/sin θ, of a layer of
optical depth β_v = 10^(-5.2577 + 0.4701 U) (f/25)^0.85, above U = 11 that of U = 11 times (U/11)^3.5; δ_r = 0.0136,
δ = 0.0255 f^(1/3). t is the slope of the facet that mirrors the way in to the way out, t = cot θ in backscatter.

In backscatter, where γ and G are 1, this is exactly the model of APL-UW TR 9407 (1994), part II, fitted from 10 to 100
kHz and extrapolated beyond. The bistatic extension keeps σ reciprocal:

- Bubbles lie under a mirror and scatter δ_r/δ of the extinguished energy evenly. Of the four paths by a bubble, two
  touch the mirror never or twice. The two that touch it once are each other's reverse; near backscatter they add in
  pressure,
  γ = 1/(1 + (2 k L |w_i - w_s|)²), w the directions and L the depth of the layer of Hall (1989).
- Facets are the Kirchhoff lobe at high frequency, which in backscatter is the term of TR 9407 near the vertical: one
  lobe, counted once. G = 1/(1 + Λ_i + Λ_s) are its shadows (Smith, 1967).
- Ripples follow perturbation theory with the spectrum K^-4, which corresponds to the tan⁴ θ of TR 9407.
- Half of the loss in decibels belongs to the incident path, half to the scattered path.

The slope variance s² is that of TR 9407 everywhere. Like that under a slick, 0.008 + 1.56e-3 U (Cox and Munk, 1954),
where waves shorter than the acoustic wavelength are missing, it is below the optical value 0.003 + 5.12e-3 U: 0.018
instead of 0.029 at 5 m/s, 0.025 instead of 0.054 at 10 m/s. With the optical value, backscatter at 90 degrees would be
2.0 and 3.4 dB below TR 9407.

Energy: from 20 degrees of grazing and 3 m/s upwards the surface scatters 10^(-SBL/10) of the incident energy to within
0.5 dB (to 15 m/s at 30 kHz), as F cuts the tails of the facets; below, shadows remove up to 0.4 dB more, and at 1 m/s F
removes 0.9 dB.

Where a mesh has the waves longer than l, s² is what is left of it: less the mean square slope of those waves in the sea
that the wind raises in the end (Pierson and Moskowitz, 1964), but at least a tenth.
"""
from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType, SimpleNamespace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers, Triple
from mitsonar.water.sea_waves import WaveSpectrum, developed_sea

ALBEDO, ABSORBED = 0.0136, 0.0255  # δ_r, and δ at 1 kHz, of bubbles at resonance
BLEND = 0.524                      # [1/degree] of slope angle
STEEP = np.tan(np.radians(5.0))    # ripples scatter only at slope angles above this
RIPPLES = 1.3e-5                   # [s/m]
FACET_SHARE = 0.9                  # of the directions drawn; the rest are drawn evenly for bubbles and ripples
LEFT_AT_LEAST = 0.1                # of the slope variance, where a mesh has the long waves
SMALLEST_SINE = 1e-6               # of the grazing angle: no scattering below
_NUMPY = SimpleNamespace(exp=np.exp, sqrt=np.sqrt, minimum=np.minimum, maximum=np.maximum, select=np.where,
                         atan=np.arctan, log=np.log, erf=lambda x: scipy.special.erf(x))


class Roughness(NamedTuple):
    """All wind-dependent parameters of the law, as plain or device numbers."""

    slope_variance: Numbers  # s², of both components of the slope together
    crossover_deg: Numbers  # [degrees]: arctan t_f, the slope angle at which facets give way to ripples
    ripples: Numbers  # 1.3e-5 U
    loss_db: Numbers  # [dB]: SBL sin θ at 1 kHz
    bubbles: Numbers  # β_v at 1 kHz
    layer_depth: Numbers  # [m]: L


def roughness(wind_speed: float, longest_wave: float = np.inf) -> Roughness:
    """Return the `Roughness` of a wind speed [m/s], of waves up to a length l [m].

    Depth of the bubble layer after Hall (1989), J. Acoust. Soc. Am. 86, 1103: 0.4 m to 7.5 m/s, then 0.115 m more for
    each m/s.
    """
    wind = float(wind_speed)
    variance = 4.6e-3 * np.log(2.1 * max(wind, 1.0) ** 2)
    if wind > 0 and np.isfinite(longest_wave):
        long_waves = WaveSpectrum.model(*developed_sea(wind)).slope_variance(longest_wave)
        variance = max(variance - long_waves, LEFT_AT_LEAST * variance)
    square = variance                                     # t_f²; the map contracts by 2 s²
    for _ in range(20):
        square = variance * (1.5 * np.log(10) + 2 * np.log1p(square))
    bubbles = 10 ** (-5.2577 + 0.4701 * min(wind, 11.0)) * 25**-0.85 * max(wind / 11, 1.0) ** 3.5
    return Roughness(slope_variance=variance, crossover_deg=float(np.degrees(np.arctan(np.sqrt(square)))),
                     ripples=RIPPLES * wind, loss_db=float(_loss_db(wind)), bubbles=bubbles,
                     layer_depth=0.4 + 0.115 * max(wind - 7.5, 0.0))


def bubble_loss_db(grazing_angle: ArrayLike, frequency: ArrayLike, wind_speed: ArrayLike) -> np.ndarray:
    """Return the loss of one surface reflection to the bubbles under the surface.

    Parameters
    ----------
    grazing_angle : array [rad]
        0..π/2.
    frequency : array [Hz]
        Frequency; the fit covers 10 to 100 kHz.
    wind_speed : array [m/s]
        At 10 m height. All arguments broadcast.

    Returns
    -------
    array [dB]
        Positive loss; inf at grazing angle 0.

    Notes
    -----
    APL-UW TR 9407 (1994), part II, section D.
    """
    grazing_angle, wind_speed = np.asarray(grazing_angle, float), np.asarray(wind_speed, float)
    with np.errstate(divide="ignore"):
        return _loss_db(wind_speed) * (np.asarray(frequency, float) / 1e3) ** 0.85 / np.sin(grazing_angle)


def _loss_db(wind_speed: Numbers) -> Numbers:
    """Return SBL sin θ at 1 kHz."""
    return 1.26e-3 * np.maximum(wind_speed, 6.0) ** 1.57 * np.exp(1.2 * np.minimum(wind_speed - 6.0, 0.0))


def strength(lib: ModuleType | SimpleNamespace | None, surface: Roughness, wi: Triple, wo: Triple, frequency: Numbers,
             sound_speed: Numbers) -> Numbers:
    """Return σ [-] at a frequency [Hz] and sound speed [m/s]."""
    lib = lib or _NUMPY
    khz = frequency * 1e-3
    seen = (wi[2] > SMALLEST_SINE) & (wo[2] > SMALLEST_SINE)
    sin_i, sin_s = lib.maximum(wi[2], SMALLEST_SINE), lib.maximum(wo[2], SMALLEST_SINE)
    both = sin_i + sin_s
    slope = ((wi[0] + wo[0]) ** 2 + (wi[1] + wo[1]) ** 2) / (both * both)               # t²
    apart = (wi[0] - wo[0]) ** 2 + (wi[1] - wo[1]) ** 2 + (wi[2] - wo[2]) ** 2
    per_sine = khz**0.85 * (1 / sin_i + 1 / sin_s)
    loss = lib.exp(-float(np.log(10) / 20) * surface.loss_db * per_sine)
    shadow = 1 / (1 + _hidden(lib, sin_i, surface.slope_variance) + _hidden(lib, sin_s, surface.slope_variance))
    facets = (shadow * lib.exp(-slope / surface.slope_variance) * (1 + slope) ** 2
              / (float(4 * np.pi) * surface.slope_variance))
    even = 4 * sin_i * sin_s / (both * both)
    ripples = lib.select(slope >= STEEP**2, surface.ripples * (even / lib.maximum(slope, STEEP**2)) ** 2, 0)
    angle_deg = float(180 / np.pi) * lib.atan(lib.sqrt(slope))
    share = 1 / (1 + lib.exp(lib.minimum(BLEND * (angle_deg - surface.crossover_deg), 60.0)))
    rough = (share * facets + (1 - share) * ripples) * loss
    phase = 2 * float(2 * np.pi) * frequency / sound_speed * surface.layer_depth
    return lib.select(seen, rough + _bubbles(lib, surface.bubbles * khz**0.85, sin_i, sin_s, khz,
                                             1 / (1 + phase * phase * apart)), 0)


def _hidden(lib: ModuleType | SimpleNamespace, sine: Numbers, variance: Numbers) -> Numbers:
    """Return Smith's Λ of a direction: hidden area over visible area."""
    v = sine * lib.sqrt(1 / (lib.maximum(1 - sine * sine, 1e-9) * variance))
    v = lib.minimum(v, 6.0)                                                             # Λ < 1e-17
    return lib.maximum(0.5 * (lib.exp(-v * v) * float(1 / np.sqrt(np.pi)) / v - (1 - lib.erf(v))), 0.0)


def _bubbles(lib: ModuleType | SimpleNamespace, depth: Numbers, sin_i: Numbers, sin_s: Numbers, khz: Numbers,
             coherence: Numbers) -> Numbers:
    """Return σ_b of a layer of optical depth `depth`; `coherence` -> γ."""
    beta_i, beta_s = depth / sin_i, depth / sin_s
    once = (1 + coherence) * lib.exp(-2 * lib.minimum(beta_i, beta_s)) * _fall(lib, 2 * abs(beta_i - beta_s))
    albedo = float(ALBEDO / ABSORBED) * khz ** (-1 / 3)
    return albedo * depth * float(1 / (2 * np.pi)) * (_fall(lib, 2 * (beta_i + beta_s)) + once)


def _fall(lib: ModuleType | SimpleNamespace, y: Numbers) -> Numbers:
    """Return h(y) = (1 - e^-y)/y, exact near 0."""
    far = lib.maximum(y, 0.05)
    near = lib.minimum(y, 0.05)
    return lib.select(y > 0.05, (1 - lib.exp(-far)) / far,
                      1 - near * (0.5 - near * (1 / 6 - near * (1 / 24 - near / 120))))


def facet_direction(lib: ModuleType, variance: Numbers, wi: Triple, u: Numbers,
                    v: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return `wi` mirrored by a facet of Gaussian slope, drawn by (u, v) in [0, 1)²."""
    t = lib.sqrt(-variance * lib.log(lib.maximum(1 - u, 1e-12)))
    sine, cosine = lib.sincos(float(2 * np.pi) * v)
    z = 1 / lib.sqrt(1 + t * t)
    x, y = t * cosine * z, t * sine * z
    twice = 2 * (wi[0] * x + wi[1] * y + wi[2] * z)
    return twice * x - wi[0], twice * y - wi[1], twice * z - wi[2]


def facet_density(lib: ModuleType | SimpleNamespace | None, variance: Numbers, wi: Triple, wo: Triple) -> Numbers:
    """Return the density [1/sr] of `facet_direction` at `wo`, 0 below the surface.

    A slope's density is e^(-t²/s²)/(π s²). Slopes to normals: cos³; normals to directions: 4 cos χ, χ the angle between
    a direction and the normal.
    """
    lib = lib or _NUMPY
    x, y, z = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    seen = (wi[2] > 0) & (wo[2] > 0)
    z = lib.maximum(z, 1e-6)
    slope = (x * x + y * y) / (z * z)
    tilt = lib.sqrt(1 + slope)                                                          # 1/cos of the facet's slope
    cosine = 0.5 * z * tilt                                                             # cos χ = |w_i + w_s|/2
    density = lib.exp(-slope / variance) * tilt**3 / (float(4 * np.pi) * variance * lib.maximum(cosine, 1e-6))
    return lib.select(seen, density, 0)


@dataclass(frozen=True, kw_only=True)
class SeaSurface:
    """Sea surface under a wind, seen from below.

    Parameters
    ----------
    wind_speed : float [m/s]
        Wind speed at 10 m height; 0 is a mirror without scattering.

    Raises
    ------
    ValueError
        If the wind speed is not in 0..60 m/s.
    """

    wind_speed: float

    def __post_init__(self):
        if not 0 <= self.wind_speed <= 60:
            raise ValueError(f"sea_surface: wind_speed is {self.wind_speed} m/s; it must lie in 0..60 m/s.")

    def scattering_strength(self, grazing_in: ArrayLike, grazing_out: ArrayLike, azimuth: ArrayLike,
                            frequency: ArrayLike, sound_speed: ArrayLike) -> np.ndarray:
        """Return σ [-], for angles [rad], frequency [Hz] and sound speed [m/s] that broadcast."""
        way_in, way_out, azimuth, frequency, sound_speed = np.broadcast_arrays(
            *(np.asarray(value, float) for value in (grazing_in, grazing_out, azimuth, frequency, sound_speed)))
        if self.wind_speed == 0:
            return np.zeros(way_in.shape)
        zero = np.zeros(way_in.shape)
        # wi points towards the source, so forward scattering (azimuth 0) points away from it
        wi = -np.cos(way_in), zero, np.sin(way_in)
        wo = np.cos(way_out) * np.cos(azimuth), np.cos(way_out) * np.sin(azimuth), np.sin(way_out)
        return strength(None, roughness(self.wind_speed), wi, wo, frequency, sound_speed)
