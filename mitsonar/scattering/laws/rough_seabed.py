"""Base of fluid and solid seabeds: a rough surface by small slopes, and a volume below.

    σ = |a|² × factor of the lobe + σ_volume          (a, σ_volume: `fluid`, `elastic`; the lobe: `small_slope`)

θ_i, θ_s -> ``grazing_in``, ``grazing_out``, φ -> ``azimuth`` (0 forward, π back), k -> ``wavenumber``. The rough part
holds all reflected energy, near-specular lobe included; do not add a specular echo of the same seabed.
"""
from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from mitsonar.device.types import Real

from ..surfaces.arithmetic import power
from ..surfaces.elastic import Elastic
from ..surfaces.fluid import Fluid
from ..surfaces.resolved import cut, log_ratio, resolved_factor
from ..surfaces.rough_interface import log_lobe
from ..surfaces.small_slope import lobe_factor


class RoughSeabed(ABC):
    """Scattering of a rough seabed, whose parameters are fields of the subclasses."""
    # mesh_resolution [m]

    w2: float  # [m^(4 - gamma)]: the roughness spectrum is w2 K^-gamma
    gamma: float  # [-]
    name: str  # name in error messages
    mesh_resolution = 0.0
    steepest, steep = 1.7, 1.0     # of sandy gravel, the coarsest that is fluid, at 950 and 230 kHz

    @property
    @abstractmethod
    def below(self) -> Fluid | Elastic:
        """Return the half-space under the surface."""

    def roughness_slope(self, wavenumber: Real) -> np.ndarray:
        """Return the root-mean-square slope [-] of the roughness that sound of ``wavenumber`` [rad/m] sees, to 2 k."""
        return np.sqrt(2 * np.pi * self.w2 * (2 * wavenumber) ** (4 - self.gamma) / (4 - self.gamma))

    def rough_strength(self, grazing_in: Real, grazing_out: Real, azimuth: Real, wavenumber: Real) -> np.ndarray:
        """Return σ [-] of the surface alone, at any frequency, for angles [rad] and wavenumber [rad/m] that broadcast.
        """
        cos_i, cos_s, sin_i, sin_s = np.cos(grazing_in), np.cos(grazing_out), np.sin(grazing_in), np.sin(grazing_out)
        # (cos θ_i - cos θ_s)² + 4 cos cos sin²(φ/2): the shift of the transverse wavenumber, without cancellation
        shift = (cos_i - cos_s) ** 2 + 4 * cos_i * cos_s * np.sin(azimuth / 2) ** 2
        seen = shift, sin_i + sin_s, wavenumber, self.w2, self.gamma
        if self.mesh_resolution:
            factor = resolved_factor(np, log_lobe, log_ratio(self.gamma), *seen, cut(self.mesh_resolution))
        else:
            factor = lobe_factor(np, log_lobe, *seen)
        return power(self.below.amplitude(sin_i, sin_s, cos_i * cos_s * np.cos(azimuth))) * factor

    def volume_strength(self, grazing_in: Real, grazing_out: Real) -> np.ndarray:
        """Return σ [-] of the volume alone, for angles [rad] that broadcast; the same in all azimuths and frequencies.
        """
        return self.below.volume_strength(np.sin(grazing_in), np.sin(grazing_out))

    def scattering_strength(self, grazing_in: Real, grazing_out: Real, azimuth: Real, frequency: Real,
                            sound_speed: Real) -> np.ndarray:
        """Return σ [-] of surface and volume, for angles [rad], frequency [Hz], sound speed [m/s] that broadcast."""
        wavenumber = 2 * np.pi * frequency / sound_speed
        self.check(np.max(frequency, initial=0.0), np.max(wavenumber, initial=0.0))
        return (self.rough_strength(grazing_in, grazing_out, azimuth, wavenumber)
                + self.volume_strength(grazing_in, grazing_out))

    def check(self, frequency: float, wavenumber: float) -> None:
        """Raise `ValueError` if the law does not hold at a frequency [Hz] and its wavenumber [rad/m] in the water."""
        slope = self.roughness_slope(wavenumber)
        if slope > self.steepest:
            raise ValueError(
                f"{self.name} at {frequency / 1e3:g} kHz is too rough for the law of small slopes: its features down "
                f"to half a wavelength have a root-mean-square slope of {slope:.2g}, and the law holds up to "
                f"{self.steepest:g}; take a lower frequency or the law lambert.")

    def doubt(self, frequency: float, wavenumber: float) -> str | None:
        """Return a warning if the law is doubtful at a frequency [Hz] and its wavenumber [rad/m], else None."""
        slope = self.roughness_slope(wavenumber)
        if slope <= self.steep:
            return None
        return (f"{self.name} at {frequency / 1e3:g} kHz is rougher than the law of small slopes is sure of (slope "
                f"{slope:.2g}): within 30 degrees of nadir its levels are too low by some dB")

    def _check_bounds(self, bounds: Mapping[str, tuple[float, float]], or_none: tuple[str, ...] = ()) -> None:
        """Raise `ValueError` if a field is not above and up to its bounds; those in ``or_none`` may be 0."""
        for field, (low, high) in bounds.items():
            value, zero = getattr(self, field), field in or_none
            if not (low < value <= high or zero and value == 0):
                least = "at least" if zero else "above"
                raise ValueError(f"{self.name}: {field} is {value}; it must be {least} {low:g} and at most {high:g}.")
        if not 0 <= self.mesh_resolution < np.inf:
            raise ValueError(f"{self.name}: mesh_resolution is {self.mesh_resolution}; it must be a finite number [m], "
                             "0 for none.")
