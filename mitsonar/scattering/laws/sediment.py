"""Fluid sediments, by name or by parameters: a rough surface (`rough_seabed`) and the volume below (`fluid`).

ρ, ν of the sediment over those of water -> ``density_ratio``, ``sound_speed_ratio``; δ -> ``loss``; σ2 ->
``volume_parameter``; w2, γ of the roughness -> ``w2``, ``gamma``. Time factor exp(-iωt).
"""
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mitsonar.device.types import Real
from mitsonar.seabed.roughness import GAMMA_TR9407, W2_CM4_TR9407, sediment_key, w2_from_cm4

from ..surfaces.arithmetic import NUMPY
from ..surfaces.fluid import Fluid
from ..surfaces.rough_interface import ALPHA_RANGE
from .rough_seabed import RoughSeabed

HIGHEST_AS_FLUID = 100e3           # [Hz], of rock and cobble

# APL-UW TR 9407 (1994), section IV, Table 2: density ratio, sound speed ratio, loss, volume parameter.
_ROWS = {
    ("rough rock", "rock"): (2.5, 2.5, 0.01374, 0.002),
    ("cobble", "gravel", "pebble"): (2.5, 1.8, 0.01374, 0.002),
    ("sandy gravel",): (2.492, 1.3370, 0.01705, 0.002),
    ("very coarse sand",): (2.401, 1.3067, 0.01667, 0.002),
    ("muddy sandy gravel",): (2.314, 1.2778, 0.01630, 0.002),
    ("coarse sand", "gravelly sand"): (2.231, 1.2503, 0.01638, 0.002),
    ("gravelly muddy sand",): (2.151, 1.2241, 0.01645, 0.002),
    ("medium sand", "sand"): (1.845, 1.1782, 0.01624, 0.002),
    ("muddy gravel",): (1.615, 1.1396, 0.01610, 0.002),
    ("fine sand", "silty sand"): (1.451, 1.1073, 0.01602, 0.002),
    ("muddy sand",): (1.339, 1.0800, 0.01728, 0.002),
    ("very fine sand",): (1.268, 1.0568, 0.01875, 0.002),
    ("clayey sand",): (1.224, 1.0364, 0.02019, 0.002),
    ("coarse silt",): (1.195, 1.0179, 0.02158, 0.002),
    ("sandy silt", "gravelly mud"): (1.169, 0.9999, 0.01261, 0.002),
    ("medium silt", "sand silt clay"): (1.149, 0.9885, 0.00676, 0.001),
    ("silt", "sandy mud"): (1.149, 0.9873, 0.00386, 0.001),
    ("fine silt", "clayey silt"): (1.148, 0.9861, 0.00306, 0.001),
    ("sandy clay",): (1.147, 0.9849, 0.00242, 0.001),
    ("very fine silt",): (1.147, 0.9837, 0.00194, 0.001),
    ("silty clay",): (1.146, 0.9824, 0.00163, 0.001),
    ("clay",): (1.145, 0.9800, 0.00148, 0.001),
}
_SOLID = ("rough rock", "rock", "cobble", "gravel", "pebble")
BOUNDS = {                         # name -> (above, up to); zero loss or roughness would leave 0/0
    "density_ratio": (0.0, 10.0), "sound_speed_ratio": (0.0, 5.0), "loss": (0.0, 1.0), "volume_parameter": (0.0, 1.0),
    "w2": (0.0, 1.0), "gamma": tuple(2 + 2 * alpha for alpha in ALPHA_RANGE),
}


@dataclass(frozen=True, kw_only=True)
class Sediment(RoughSeabed):
    """Fluid sediment.

    Parameters
    ----------
    density_ratio, sound_speed_ratio : float [-]
        Density and sound speed of the sediment over those of the water above.
    loss : float [-]
        Imaginary over real part of the wavenumber in the sediment; 1 dB per wavelength is 1/54.575.
    volume_parameter : float [-]
        Scattering of the volume, per absorption: cross section [1/m] over absorption [dB/m]; 0 for none.
    w2 : float [m^(4 - gamma)]
        Strength of the roughness spectrum w2 K^-gamma, whose integral over both wavenumbers is the height variance.
    gamma : float [-]
        Exponent of the roughness spectrum, 2.4..3.9.
    solid : bool
        True for a material with shear waves, which the fluid model lacks; it is refused at 100 kHz and above.
    mesh_resolution : float [m]
        Node spacing of a mesh that already holds the larger features of this roughness; the law then leaves them out.
        0 without such a mesh. See `resolved`.
    name : str
        Name in error messages.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Notes
    -----
    Rough surface: Thorsos and Broschat (1995), J. Acoust. Soc. Am. 97, 2082; Jackson and Richardson (2007),
    High-Frequency Seafloor Acoustics, chapter 13. Volume: Jackson, Winebrenner and Ishimaru (1986), J. Acoust. Soc.
    Am. 79, 1410. Most accurate for gentle roughness (slopes up to 0.3) and grazing angles above the slopes, as shadows
    are left out. Rock and cobble carry shear waves and are several dB uncertain even below 100 kHz; see
    `ElasticSediment`.
    """

    density_ratio: float
    sound_speed_ratio: float
    loss: float
    volume_parameter: float
    w2: float
    gamma: float = GAMMA_TR9407
    solid: bool = False
    mesh_resolution: float = 0.0
    name: str = "sediment"

    def __post_init__(self):
        self._check_bounds(BOUNDS, or_none=("volume_parameter",))

    @classmethod
    def of(cls, name: str, **changes: Any) -> "Sediment":
        """Return the sediment of TR 9407 called ``name``, such as "medium sand", with ``changes`` to its fields."""
        return replace(SEDIMENTS[sediment_key(name)], **changes)

    def reflection(self, grazing: Real) -> np.ndarray:
        """Return the complex reflection coefficient R [-] of the flat surface, at grazing angles [rad] of any shape."""
        return self.below.reflection(np.sin(grazing))

    def check(self, frequency: float, wavenumber: float) -> None:
        """Raise `ValueError` if the law does not hold at a frequency [Hz] and its wavenumber [rad/m] in the water."""
        super().check(frequency, wavenumber)
        if self.solid and frequency >= HIGHEST_AS_FLUID:
            raise ValueError(
                f"{self.name} at {frequency / 1e3:g} kHz is not a fluid: it bears shear waves, which this law leaves "
                f"out; take the law elastic, or a frequency below {HIGHEST_AS_FLUID / 1e3:g} kHz.")

    @property
    def below(self) -> Fluid:
        """Return the half-space under the surface."""
        return Fluid(arithmetic=NUMPY, density_ratio=self.density_ratio, sound_speed_ratio=self.sound_speed_ratio,
                     loss=self.loss, volume_parameter=self.volume_parameter)


def _sediments() -> Iterator[tuple[str, Sediment]]:
    for names, (density, speed, loss, volume) in _ROWS.items():
        for name in names:
            yield name, Sediment(density_ratio=density, sound_speed_ratio=speed, loss=loss, volume_parameter=volume,
                                 w2=w2_from_cm4(W2_CM4_TR9407[name], GAMMA_TR9407), solid=name in _SOLID, name=name)


SEDIMENTS = dict(_sediments())     # by name, synonyms included
