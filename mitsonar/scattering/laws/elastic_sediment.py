"""Solid seabeds, by name or by parameters: a rough surface (`rough_seabed`) and the volume below (`elastic`).

ρ, ν, ν_t of the solid over those of water -> ``density_ratio``, ``sound_speed_ratio``, ``shear_speed_ratio``; δ, δ_t
-> ``loss``, ``shear_loss``; w2, γ of the roughness -> ``w2``, ``gamma``; w3, f of the volume -> ``w3``,
``fluctuations``. Time factor exp(-iωt).
"""
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mitsonar.device.types import Real
from mitsonar.seabed.roughness import sediment_key

from ..surfaces.arithmetic import NUMPY, power
from ..surfaces.elastic import Elastic
from ..surfaces.rough_interface import ALPHA_RANGE
from .rough_seabed import RoughSeabed

STEEPEST_PUBLISHED = 3.0           # largest roughness slope of the published levels: rough rock at 300 kHz
FASTEST_SHEAR = 0.75**0.5          # over the compressional speed: here the bulk modulus is 0
ELASTIC_BOUNDS = {                 # name -> (above, up to)
    "density_ratio": (0.0, 10.0), "sound_speed_ratio": (0.0, 5.0), "loss": (0.0, 1.0),
    "shear_speed_ratio": (0.0, 4.0), "shear_loss": (0.0, 1.0), "w3": (0.0, 1.0),
    "w2": (0.0, 1.0), "gamma": tuple(2 + 2 * alpha for alpha in ALPHA_RANGE),
}

# Parameters of the levels in APL-UW TM 2-00 (Jackson 2000): density and compressional speed ratio, loss; shear speed
# ratio, loss; w2, γ; w3, f.
_ROWS = {
    ("cobble", "gravel", "pebble"): (2.5, 1.8, 0.01374, 1.01, 0.1, 2.5e-4, 3.0, 1.52e-3, (1.0, 0.0, 0.0)),
    ("rock",): (2.5, 2.3, 0.00174, 1.31, 0.085, 2.5e-4, 3.0, 6e-5, (1.0, 3.0, 4.0)),
    ("rough rock",): (2.5, 2.3, 0.00174, 1.3, 0.085, 1e-4, 2.75, 2e-4, (1.0, 3.0, 4.0)),
}


@dataclass(frozen=True, kw_only=True)
class ElasticSediment(RoughSeabed):
    """Solid seabed, which carries shear waves.

    Parameters
    ----------
    density_ratio, sound_speed_ratio : float [-]
        Density and compressional wave speed over those of the water above.
    loss : float [-]
        Imaginary over real part of the compressional wavenumber; 1 dB per wavelength is 1/54.575.
    shear_speed_ratio, shear_loss : float [-]
        Speed ratio and loss of shear waves, slower than 0.866 of the compressional speed.
    w2 : float [m^(4 - gamma)]
        Strength of the roughness spectrum w2 K^-gamma, whose integral over both wavenumbers is the height variance.
    gamma : float [-]
        Exponent of the roughness spectrum, 2.4..3.9.
    w3 : float [-]
        Strength of the spectrum w3 K^-3 of the volume's fluctuations; 0 for a uniform volume.
    fluctuations : (float, float, float) [-]
        Relative fluctuations of density, compressional and shear speed.
    mesh_resolution : float [m]
        Node spacing of a mesh that already holds the larger features of this roughness; the law then leaves them out.
        0 without such a mesh. See `resolved`.
    name : str
        Name in error messages.

    Raises
    ------
    ValueError
        If a number is out of its range, or the seabed would return more energy than arrives.

    Notes
    -----
    `Elastic` lists the sources and the limits of the volume model. Slopes are gentle up to about 20 kHz only. Near
    nadir the rough part is too weak: for rock by 2 dB at 20 kHz, 6 at 75 and 15 at 300, where the volume's echo is
    stronger.

    Examples
    --------
    >>> import numpy as np
    >>> from mitsonar.scattering import ElasticSediment, backscatter_strength_db
    >>> backscatter_strength_db(ElasticSediment.of("rock"), np.radians([20, 45]), 20e3).round(2)
    array([-17.27, -12.76])
    """

    density_ratio: float
    sound_speed_ratio: float
    loss: float
    shear_speed_ratio: float
    shear_loss: float
    w2: float
    w3: float
    gamma: float = 3.0
    fluctuations: tuple[float, float, float] = (1.0, 0.0, 0.0)
    mesh_resolution: float = 0.0
    name: str = "solid"

    steepest = STEEPEST_PUBLISHED

    def __post_init__(self):
        self._check_bounds(ELASTIC_BOUNDS, or_none=("w3",))
        fastest = FASTEST_SHEAR * self.sound_speed_ratio
        if self.shear_speed_ratio >= fastest:
            raise ValueError(f"{self.name}: shear_speed_ratio is {self.shear_speed_ratio}; it must be below "
                             f"{fastest:.4g}, {FASTEST_SHEAR:.3f} of the sound_speed_ratio.")
        if len(self.fluctuations) != 3 or not np.isfinite(self.fluctuations).all():
            raise ValueError(f"{self.name}: fluctuations are {self.fluctuations}; they must be three finite numbers, "
                             "of density, compressional speed and shear speed.")
        most = self._most_sent_back()
        if most > 1:
            raise ValueError(f"{self.name}: reflection and volume send back {most:.3g} times what arrives; lower w3 or "
                             "the fluctuations, or raise the loss.")

    @classmethod
    def of(cls, name: str, **changes: Any) -> "ElasticSediment":
        """Return the "cobble", "rock" or "rough rock" of TM 2-00, with ``changes`` to its fields."""
        key = sediment_key(name)
        if key not in ELASTIC_SEDIMENTS:
            raise ValueError(f"{key} is not among the solid seabeds, which are {', '.join(ELASTIC_SEDIMENTS)}; take "
                             "the law sediment, or give the parameters.")
        return replace(ELASTIC_SEDIMENTS[key], **changes)

    def reflection(self, grazing: Real) -> np.ndarray:
        """Return the complex reflection coefficient R [-] of the flat surface, at grazing angles [rad] of any shape."""
        return self.below.reflection(np.sin(grazing))

    @property
    def below(self) -> Elastic:
        """Return the half-space under the surface."""
        return Elastic(arithmetic=NUMPY, density_ratio=self.density_ratio, sound_speed_ratio=self.sound_speed_ratio,
                       loss=self.loss, shear_speed_ratio=self.shear_speed_ratio, shear_loss=self.shear_loss,
                       w3=self.w3, fluctuations=self.fluctuations)

    def _most_sent_back(self) -> float:
        """Return the maximum over grazing angles of |R|² + ∫ σ_volume dΩ / sin θ_i, with dΩ = 2π d(sin θ_s)."""
        sine_in, sine_out = (np.arange(90) + 0.5)[:, None] / 90, (np.arange(180) + 0.5) / 180
        volume = self.below.volume_strength(sine_in, sine_out).mean(-1, keepdims=True)
        return np.max(power(self.below.reflection(sine_in)) + 2 * np.pi * volume / sine_in)


def _solids() -> Iterator[tuple[str, ElasticSediment]]:
    for names, (density, speed, loss, shear_speed, shear_loss, w2, gamma, w3, fluctuations) in _ROWS.items():
        for name in names:
            yield name, ElasticSediment(
                density_ratio=density, sound_speed_ratio=speed, loss=loss, shear_speed_ratio=shear_speed,
                shear_loss=shear_loss, w2=w2, gamma=gamma, w3=w3, fluctuations=fluctuations, name=name)


ELASTIC_SEDIMENTS = dict(_solids())    # by name, synonyms included
