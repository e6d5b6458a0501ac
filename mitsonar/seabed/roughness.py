"""Isotropic power-law spectra of bottom roughness, with an outer scale.

    W(K) = w2 / (K^2 + K0^2)^(gamma/2),    K0 = 2 pi / L0                                   (von Karman form)
    integral of W over both wavenumbers = height variance = 2 pi w2 K0^(2 - gamma) / (gamma - 2)

W -> spectrum [m^4], K -> ``wavenumber`` [rad/m], w2 -> ``w2`` [m^(4 - gamma)], gamma -> ``gamma``,
L0 -> ``outer_scale`` [m]. Well above K0 this is the pure power law w2 K^-gamma; below, it levels off, which makes
the variance finite. Published tables give w2 in cm^4 with a reference length of 1 cm:

    w2 [m^(4 - gamma)] = 1e-8 * 100^gamma * w2 [cm^4]
"""
from dataclasses import dataclass

import numpy as np

from mitsonar.device.spelling import meant
from mitsonar.device.types import Real

# APL-UW TR 9407 (1994), High-Frequency Ocean Environmental Acoustic Models Handbook, section IV, Table 2: spectral
# strength w2 [cm^4] of each sediment. The spectral exponent is 3.25 for all of them.
GAMMA_TR9407 = 3.25
W2_CM4_TR9407 = {
    "rough rock": 0.20693, "rock": 0.01862, "cobble": 0.016, "gravel": 0.016, "pebble": 0.016,
    "sandy gravel": 0.012937, "very coarse sand": 0.010573, "muddy sandy gravel": 0.008602, "coarse sand": 0.006957,
    "gravelly sand": 0.006957, "gravelly muddy sand": 0.005587, "medium sand": 0.004446, "sand": 0.004446,
    "muddy gravel": 0.003498, "fine sand": 0.002715, "silty sand": 0.002715, "muddy sand": 0.002070,
    "very fine sand": 0.001544, "clayey sand": 0.001119, "coarse silt": 0.000781, "sandy silt": 0.000518,
    "gravelly mud": 0.000518, "medium silt": 0.000518, "sand silt clay": 0.000518, "silt": 0.000518,
    "sandy mud": 0.000518, "fine silt": 0.000518, "clayey silt": 0.000518, "sandy clay": 0.000518,
    "very fine silt": 0.000518, "silty clay": 0.000518, "clay": 0.000518}


@dataclass(frozen=True, kw_only=True)
class RoughnessSpectrum:
    """Isotropic power-law spectrum of heights."""

    w2: float  # [m^(4 - gamma)]: spectral strength, at least 0
    gamma: float = GAMMA_TR9407  # above 2, where small features would dominate, and below 4, where large ones would
    outer_scale: float = 10.0  # [m]: wavelength at which the power law levels off

    def __post_init__(self):
        for name, holds, expected in (("w2", 0 <= self.w2 < np.inf, "a finite number, at least 0"),
                                      ("gamma", 2 < self.gamma < 4, "between 2 and 4"),
                                      ("outer_scale", 0 < self.outer_scale < np.inf, "a finite number [m] above 0")):
            if not holds:
                raise ValueError(f"roughness spectrum: {name} is {getattr(self, name)}; it must be {expected}.")

    @classmethod
    def of_sediment(cls, name: str, *, outer_scale: float = 10.0) -> "RoughnessSpectrum":
        """Return the spectrum of a sediment of TR 9407, such as "medium sand" (``-`` and ``_`` read as a space)."""
        w2 = w2_from_cm4(W2_CM4_TR9407[sediment_key(name)], GAMMA_TR9407)
        return cls(w2=w2, gamma=GAMMA_TR9407, outer_scale=outer_scale)

    @classmethod
    def of_height(cls, rms_height: float, *, gamma: float = GAMMA_TR9407,
                  outer_scale: float = 10.0) -> "RoughnessSpectrum":
        """Return the spectrum of a surface with the root-mean-square height ``rms_height`` [m]."""
        if not 0 <= rms_height < np.inf:
            raise ValueError(f"roughness spectrum: rms_height is {rms_height}; it must be a finite number [m], "
                             "at least 0.")
        unit = cls(w2=1.0, gamma=gamma, outer_scale=outer_scale)
        return cls(w2=rms_height**2 / unit.height_variance(), gamma=gamma, outer_scale=outer_scale)

    def at(self, wavenumber: Real) -> np.ndarray:
        """Return the two-sided, two-dimensional spectrum [m^4] at ``wavenumber`` [rad/m], any shape."""
        return self.w2 * (np.square(wavenumber) + self._corner**2) ** (-self.gamma / 2)

    def height_variance(self, highest_wavenumber: float = np.inf) -> float:
        """Return the variance of heights [m^2] from features up to ``highest_wavenumber`` [rad/m]."""
        exponent = 1 - self.gamma / 2
        above = 0.0 if np.isinf(highest_wavenumber) else (highest_wavenumber**2 + self._corner**2) ** exponent
        return np.pi * self.w2 * (above - self._corner ** (2 * exponent)) / exponent

    def mean_square_slope(self, highest_wavenumber: float) -> float:
        """Return the mean squared gradient [-] from features up to ``highest_wavenumber`` [rad/m].

        Notes
        -----
        pi w2 [ (s^b - K0^2b) / b - K0^2 (s^a - K0^2a) / a ] with s = Kc^2 + K0^2, a = 1 - gamma/2, b = 2 - gamma/2;
        for K0 -> 0 this is 2 pi w2 Kc^(4 - gamma) / (4 - gamma). It diverges with Kc.
        """
        s, corner = highest_wavenumber**2 + self._corner**2, self._corner**2
        a, b = 1 - self.gamma / 2, 2 - self.gamma / 2
        return np.pi * self.w2 * ((s**b - corner**b) / b - corner * (s**a - corner**a) / a)

    @property
    def _corner(self) -> float:
        return 2 * np.pi / self.outer_scale


def sediment_key(name: str) -> str:
    """Return the name of a sediment in the tables: lower case, ``-`` and ``_`` read as a space."""
    key = " ".join(str(name).lower().replace("_", " ").replace("-", " ").split())
    if key not in W2_CM4_TR9407:
        raise ValueError(f'no sediment is called "{name}"{meant(key, W2_CM4_TR9407)}; known are '
                         f'{", ".join(W2_CM4_TR9407)}.')
    return key


def w2_from_cm4(w2_cm4: float, gamma: float) -> float:
    """Return the spectral strength [m^(4 - gamma)] of a value in cm^4 with a reference length of 1 cm."""
    return 1e-8 * 100**gamma * w2_cm4
