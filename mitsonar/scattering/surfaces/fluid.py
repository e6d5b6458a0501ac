"""Fluid half-space: transmission and reflection at its flat surface, scattering by roughness and volume.

    P(θ) = sqrt(κ² - cos² θ),   κ = (1 + iδ)/ν,     1 + R = 2 ρ sin θ / (ρ sin θ + P)
    G = (1/ρ - 1)(S - P_i P_s/ρ) + 1 - κ²/ρ,        S = cos θ_i cos θ_s cos φ
    a = (1 + R_i)(1 + R_s) G                         (σ_rough = |a|² times the lobe's factor, see `small_slope`)
    σ_volume = 10 δ σ2 |1 + R_i|² |1 + R_s|² / [ν ln 10 ρ² Im(P_i + P_s)]

ρ, ν -> ``density_ratio``, ``sound_speed_ratio``, δ -> ``loss``, σ2 -> ``volume_parameter``; sin θ -> ``sine``,
S -> ``scalar``; each a number or an array. Time factor exp(-iωt).
"""
from dataclasses import dataclass

import numpy as np

from mitsonar.device.types import Numbers

from .arithmetic import Arithmetic, power


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """Parameters of a fluid sediment, as numbers or arrays of `arithmetic`."""

    arithmetic: Arithmetic
    density_ratio: Numbers  # density of the sediment over that of the water
    sound_speed_ratio: Numbers  # sound speed of the sediment over that of the water
    loss: Numbers  # imaginary over real part of the wavenumber
    volume_parameter: Numbers  # volume cross section [1/m] over absorption [dB/m]

    def vertical(self, sine: Numbers) -> Numbers:
        """Return P; the principal root has Im >= 0, as κ² lies in the upper half plane."""
        real, imaginary = self._kappa_square()
        return self.arithmetic.module.sqrt(self.arithmetic.complex(real - 1 + sine * sine, imaginary))

    def transmission(self, sine: Numbers, vertical: Numbers) -> Numbers:
        """Return 1 + R, in a form that is finite where P or sin θ is 0."""
        through = self.density_ratio * sine
        return 2 * through / (through + vertical)

    def reflection(self, sine: Numbers) -> Numbers:
        """Return the complex reflection coefficient R [-] of the flat surface."""
        return self.transmission(sine, self.vertical(sine)) - 1

    def amplitude(self, sine_in: Numbers, sine_out: Numbers, scalar: Numbers) -> Numbers:
        """Return the complex amplitude a [-] of the rough surface."""
        rho = self.density_ratio
        vertical_in, vertical_out = self.vertical(sine_in), self.vertical(sine_out)
        real, imaginary = self._kappa_square()
        contrast = ((1 / rho - 1) * (scalar - vertical_in * vertical_out / rho)
                    + self.arithmetic.complex(1 - real / rho, -imaginary / rho))
        return self.transmission(sine_in, vertical_in) * self.transmission(sine_out, vertical_out) * contrast

    def volume_strength(self, sine_in: Numbers, sine_out: Numbers) -> Numbers:
        """Return σ [-] of the volume, the same in all azimuths and at all frequencies."""
        vertical_in, vertical_out = self.vertical(sine_in), self.vertical(sine_out)
        through = power(self.transmission(sine_in, vertical_in)) * power(self.transmission(sine_out, vertical_out))
        return (float(10 / np.log(10)) * self.loss * self.volume_parameter * through
                / (self.sound_speed_ratio * self.density_ratio * self.density_ratio
                   * (vertical_in + vertical_out).imag))

    def _kappa_square(self) -> tuple[Numbers, Numbers]:
        square = self.sound_speed_ratio * self.sound_speed_ratio
        return (1 - self.loss * self.loss) / square, 2 * self.loss / square
