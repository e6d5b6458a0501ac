"""Draw noise of the sea and of the receivers for every element of an array.

    C_ij = 10^(NL/10) f_s sinc(2 |r_i - r_j| / λ) + δ_ij 10^(SN/10) f_s           [µPa²],   sinc(x) = sin(πx)/(πx)
    n = L g,   L L^T = C                                                          g circular Gaussian, variance 1
    N = w^H C w / |Σ |w||²                                                        after a beamformer

NL -> ``ambient_db`` of isotropic noise (Cook et al. 1955, J. Acoust. Soc. Am. 27, 1072), SN -> ``self_noise_db`` of
each receiver [dB re 1 µPa²/Hz]; f_s -> ``sampling_rate`` of the complex baseband, over which the noise is white. Levels
are those of an omnidirectional element; a directional one receives less by its directivity index. Numbers come from
Philox, keyed by seed and ping: the noise of a ping does not depend on the other pings drawn.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.chance import Salt
from mitsonar.units import db_from_power, power_from_db

BLOCK = 4096                       # samples drawn and mixed at a time
LEAST_OWN_NOISE = 1e-9             # share of the ambient power that keeps C of crowded arrays positive definite


def isotropic_coherence(position: ArrayLike, wavelength: float) -> np.ndarray:
    """Return the coherence of isotropic noise between elements.

    Parameters
    ----------
    position : (E, 3) [m]
    wavelength : float [m]

    Returns
    -------
    (E, E) [-]
        sin(kd)/(kd) for the distance d of two elements.
    """
    position = np.asarray(position, float)
    apart = np.linalg.norm(position[:, None] - position[None], axis=-1)
    return np.sinc(2 * apart / wavelength)


@dataclass(frozen=True, kw_only=True, eq=False)
class ElementNoise:
    """Draw noise at the elements of an array.

    Attributes
    ----------
    position : (E, 3) [m]
    wavelength : float [m]
        Wavelength at the carrier, used for the coherence over the whole band.
    sampling_rate : float [Hz]
    ambient_db : float or None [dB re 1 µPa²/Hz]
        Level of isotropic noise; None for no noise.
    self_noise_db : float or None [dB re 1 µPa²/Hz]
        Level of each receiver's own noise, independent of the others; None for no noise.
    """

    position: np.ndarray
    wavelength: float
    sampling_rate: float
    ambient_db: float | None = None
    self_noise_db: float | None = None

    def __post_init__(self):
        position = np.array(self.position, float)
        if position.ndim != 2 or position.shape[1] != 3 or len(position) == 0 or not np.all(np.isfinite(position)):
            raise ValueError(f"element noise: positions have shape {position.shape}; give finite (elements, 3) metres, "
                             "one element at least.")
        for name, unit in (("wavelength", "m"), ("sampling_rate", "Hz")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"element noise: {name} is {value} {unit}; give a finite number above 0.")
        for name in ("ambient_db", "self_noise_db"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                raise ValueError(f"element noise: {name} is {value} dB; give a finite level, or None for no noise.")
        position.flags.writeable = False
        object.__setattr__(self, "position", position)

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance C (E, E) [µPa²]."""
        ambient, own = (0.0 if level is None else float(power_from_db(level)) * self.sampling_rate
                        for level in (self.ambient_db, self.self_noise_db))
        own = max(own, LEAST_OWN_NOISE * ambient)
        return ambient * isotropic_coherence(self.position, self.wavelength) + own * np.eye(len(self.position))

    @property
    def level_db(self) -> float:
        """Return the level at one element over the band of the sampling rate [dB re 1 µPa]; -inf without noise."""
        return float(db_from_power(self.covariance[0, 0]))

    def beam_level_db(self, weight: ArrayLike) -> np.ndarray:
        """Return the level after a beamformer.

        Parameters
        ----------
        weight : complex (..., E) [-]
            Weights of the elements' signals, scaled to gain 1 for the wave they are steered at, to which all weighted
            elements add in phase.

        Returns
        -------
        array (...) [dB re 1 µPa]
            Level below `level_db` by the array's directivity index.
        """
        weight = np.asarray(weight)
        power = np.einsum("...i,ij,...j->...", weight, self.covariance, weight.conj()).real
        return db_from_power(power / np.sum(np.abs(weight), -1) ** 2)

    def drawn(self, samples: int, seed: int, ping: int) -> np.ndarray:
        """Draw the noise of one ping.

        Parameters
        ----------
        samples : int
        seed, ping : int
            Equal numbers draw equal noise; a longer record begins with the shorter one.

        Returns
        -------
        complex64 (E, samples) [µPa]
            Noise whose mean square at an element is `level_db`.
        """
        elements = len(self.position)
        noise = np.zeros((elements, samples), np.complex64)
        if not self.covariance[0, 0] > 0:
            return noise
        mask = (1 << 64) - 1
        key = np.array([int(seed) & mask, int(ping) & mask], np.uint64)
        random = np.random.Generator(np.random.Philox(key=key, counter=[0, 0, Salt.NOISE, 0]))
        for first in range(0, samples, BLOCK):
            # whole blocks are drawn, so that samples do not depend on the record's length
            mixed = (self._mixing @ random.standard_normal((elements, 2 * BLOCK))).view(complex)
            noise[:, first:first + BLOCK] = mixed[:, :samples - first]
        return noise

    @cached_property
    def _mixing(self) -> np.ndarray:
        return np.linalg.cholesky(0.5 * self.covariance)
