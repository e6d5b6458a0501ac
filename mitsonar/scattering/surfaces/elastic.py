"""Elastic half-space (with shear waves): reflection at its flat surface, scattering by roughness and volume.

    κ = (1 + iδ)/ν,   m = [ν_t / (1 + iδ_t)]²,   s = sin θ,   c = cos θ,   P = sqrt(κ² - c²),   T = sqrt(m (1 - m c²))
    C = 2 m c² - 1,   N = C² + 4 m c² P T,   B = 1 - 2 (m c² + P T),   τ = 2 ρ s / (P + ρ s N),   R = N τ - 1
    a = τ_i τ_s {(1 - 1/ρ) P_i P_s - N_i N_s (κ² - ρ + ρ S) + S (N_i B_s + N_s B_i)
                 - B_i B_s [S - 2 m (S² + (1 - 2 m κ²) c_i² c_s²)] - 2 m κ² (c_s² N_i B_s + c_i² N_s B_i)} / ρ

a is the amplitude of the rough surface (σ_rough = |a|² times the lobe's factor, see `small_slope`), to first order in
the height of the boundary, from the pressure N τ, the normal displacement P τ/ρ and the tangential displacement B τ/ρ
of the solid at its flat surface. With ν_t = 0 it reduces to `fluid`. In the volume, density, compressional and shear
speed vary together, as f = (f_ρ, f_p, f_t) times a field of spectrum w3 K^-3:

    E_pp = 2 (C τ/ρ)² κ² (f_ρ + f_p),             q_pp = 2 P                      t = τ c/ρ
    E_tt = 8 (P t)² m (f_ρ + f_t),                q_tt = 2 T/m
    E_pt = -4 C P t² (T - m P) [f_ρ + 2 (m c² + P T) (f_ρ + 2 f_t)],              q_pt = P + T/m
    σ_0 = (π/2) ρ² w3 Σ Re{i E_n E_m* [4 c² + (q_n + q_m*)²/4 + ε²]^(-3/2) / (q_n - q_m*)},      n, m: pp, pt, tt
    σ_volume = 8 σ_i² σ_s² / (σ_i + σ_s)³,   1/σ_i = 1/σ_0(θ_i) + 1/0.1,   likewise σ_s

S = c_i c_s cos φ -> ``scalar``, s -> ``sine``; ρ, ν, ν_t, those of the solid over those of water, ->
``density_ratio``, ``sound_speed_ratio``, ``shear_speed_ratio``; δ, δ_t -> ``loss``, ``shear_loss``; f ->
``fluctuations``; ε = 0.001. Time factor exp(-iωt).
"""
from dataclasses import dataclass

import numpy as np

from mitsonar.device.types import Numbers

from .arithmetic import Arithmetic

LARGEST_SCALE = 1e-3               # ε: of k, the smallest wavenumber of the volume's spectrum
STRONGEST_VOLUME = 0.1             # saturation of the volume strength, as the first order is unbounded
SMALLEST = 1e-30                   # keeps 0/0 finite at grazing angle 0, where scattering vanishes


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """Parameters of a solid, as numbers or arrays of `arithmetic`.

    Jackson and Ivakin (1998), J. Acoust. Soc. Am. 103, 336; Ivakin and Jackson (1998), J. Acoust. Soc. Am. 103, 346;
    Jackson (2000), APL-UW TM 2-00. The rough surface agrees with theirs to rounding, and exactly with first-order
    scattering. In the volume, E_pt (conversion between compression and shear) has the sign of the levels in TM 2-00;
    the change of R with density and shear speed implies the opposite sign. With the opposite sign and the same
    parameters, the volume of rock and cobble would be about 10 to 20 dB weaker below the critical angles. Their
    bistatic form is unbounded and even negative near the specular direction. Only its backscatter is used; for two
    angles a reciprocal mean of both, which keeps the scattered energy of all named solids below the incident energy.
    """

    arithmetic: Arithmetic
    density_ratio: Numbers
    sound_speed_ratio: Numbers
    loss: Numbers  # imaginary over real part of the wavenumbers
    shear_speed_ratio: Numbers
    shear_loss: Numbers  # imaginary over real part of the wavenumbers
    w3: Numbers  # [m^0]: strength of the volume's spectrum
    fluctuations: tuple[Numbers, Numbers, Numbers]

    def reflection(self, sine: Numbers) -> Numbers:
        """Return the complex reflection coefficient R [-] of the flat surface, finite where P or s is 0."""
        wave = self._wave(sine)
        return 2 * wave.through * wave.normal - 1

    def amplitude(self, sine_in: Numbers, sine_out: Numbers, scalar: Numbers) -> Numbers:
        """Return the complex amplitude a [-] of the rough surface."""
        rho, kappa2, m = self.density_ratio, self._kappa_square(), self._shear_square()
        i, o = self._wave(sine_in), self._wave(sine_out)
        converted = m * kappa2
        cross_in, cross_out = i.normal * o.along, o.normal * i.along
        stretch = m * (scalar * scalar + (1 - 2 * converted) * (i.cos2 * o.cos2))
        sources = ((1 - 1 / rho) * (i.down * o.down) - i.normal * o.normal * (kappa2 - rho + rho * scalar)
                   + scalar * (cross_in + cross_out) - i.along * o.along * (scalar - 2 * stretch)
                   - 2 * converted * (o.cos2 * cross_in + i.cos2 * cross_out))
        return (4 / rho) * (i.through * o.through * sources)

    def volume_strength(self, sine_in: Numbers, sine_out: Numbers) -> Numbers:
        """Return σ [-] of the volume, the same in all azimuths and at all frequencies."""
        back, out = self._sent_back(sine_in), self._sent_back(sine_out)
        both = back + out + SMALLEST
        back, out = back / both, out / both
        return 8 * self.w3 * (back * back * (out * out)) * both

    def _sent_back(self, sine: Numbers) -> Numbers:
        """Return σ_i over w3."""
        wave, kappa2, m = self._wave(sine), self._kappa_square(), self._shear_square()
        of_density, of_speed, of_shear = self.fluctuations
        gain = 1 / (wave.reach * wave.reach)
        turned = m * wave.cos2 + wave.down * wave.across
        energies = (8 * gain * wave.double * wave.double * kappa2 * (of_density + of_speed),
                    -16 * gain * wave.cos2 * (wave.double * wave.down * (wave.across - m * wave.down)
                                              * (of_density + 2 * turned * (of_density + 2 * of_shear))),
                    32 * gain * wave.cos2 * (wave.down * wave.down * m) * (of_density + of_shear))
        shear = wave.across / m
        depths = (2 * wave.down, wave.down + shear, 2 * shear)
        total = 0
        for n in range(3):
            for k in range(n + 1):
                mean = 0.5 * (depths[n] + self._conjugate(depths[k]))
                bragg = mean * mean + (4 * wave.cos2 + LARGEST_SCALE**2)
                term = (energies[n] * self._conjugate(energies[k])
                        / (bragg * self.arithmetic.module.sqrt(bragg) * (depths[n] - self._conjugate(depths[k]))))
                total = total - term.imag * (1 if n == k else 2)
        square = self.density_ratio * sine * sine               # the energies above are over s²
        first = (np.pi / 2) * square * square * total
        return first / (1 + self.w3 / STRONGEST_VOLUME * first)

    def _wave(self, sine: Numbers) -> "_Wave":
        """Return the wave below the surface of a plane wave from or to the water."""
        rho, m, sqrt = self.density_ratio, self._shear_square(), self.arithmetic.module.sqrt
        cos2 = 1 - sine * sine
        down = sqrt(self._kappa_square() - cos2)
        across = sqrt(m * (1 - m * cos2))
        double = 2 * m * cos2 - 1
        mixed = down * across
        normal = double * double + 4 * cos2 * (m * mixed)
        reach = down + rho * sine * normal
        return _Wave(cos2=cos2, down=down, across=across, double=double, normal=normal,
                     along=1 - 2 * (m * cos2 + mixed), reach=reach, through=rho * sine / reach)

    def _kappa_square(self) -> Numbers:
        square = self.sound_speed_ratio * self.sound_speed_ratio
        return self.arithmetic.complex((1 - self.loss * self.loss) / square, 2 * self.loss / square)

    def _shear_square(self) -> Numbers:
        """Return m, without a division by a shear speed of 0."""
        loss2 = self.shear_loss * self.shear_loss
        size = self.shear_speed_ratio / (1 + loss2)
        return self.arithmetic.complex(size * size * (1 - loss2), -2 * size * size * self.shear_loss)

    def _conjugate(self, number: Numbers) -> Numbers:
        return self.arithmetic.complex(number.real, -number.imag)


@dataclass(frozen=True, kw_only=True)
class _Wave:
    """c², P, T, C, N, B, P + ρ s N and τ/2 of one direction."""

    cos2: Numbers
    down: Numbers
    across: Numbers
    double: Numbers
    normal: Numbers
    along: Numbers
    reach: Numbers
    through: Numbers
