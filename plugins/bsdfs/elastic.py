"""Solid seabed (`elastic`): like `sediment`, but of cobble or rock, which carry shear waves.

The model is that of APL-UW TM 2-00: small slopes and volume, see `mitsonar.scattering.ElasticSediment`. Textures are
clipped to the valid range, and the shear speed to below 0.866 of the compressional speed.

.. code-block:: xml

    <bsdf type="elastic" id="reef"><string name="sediment" value="rough rock"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.scattering.laws.elastic_sediment import ELASTIC_BOUNDS, FASTEST_SHEAR, ElasticSediment
from mitsonar.scattering.surfaces.elastic import Elastic

from ..attributes import Text
from .class_map import CLASSES
from .material import COHERENCE
from .parameter import Parameter
from .sediment import MESH_RESOLUTION, SedimentBed, own
from .variation import VARIATION

SOLID = "density_ratio", "sound_speed_ratio", "loss", "shear_loss", "w3"

ATTRIBUTES = (
    Text("sediment", default="rock", text="`cobble` (`gravel`, `pebble`), `rock` or `rough rock`"),
    own("density_ratio", ELASTIC_BOUNDS, "density over the water's"),
    own("sound_speed_ratio", ELASTIC_BOUNDS, "speed of compressional waves over the water's"),
    own("loss", ELASTIC_BOUNDS, "imaginary over real wavenumber of compressional waves"),
    own("shear_speed_ratio", ELASTIC_BOUNDS, "speed of shear waves over the water's"),
    own("shear_loss", ELASTIC_BOUNDS, "imaginary over real wavenumber of shear waves"),
    own("w3", ELASTIC_BOUNDS, "strength of the spectrum of what varies in the volume; 0: nothing", or_none=True),
    own("w2", ELASTIC_BOUNDS, "strength of the roughness spectrum", unit="m^(4-γ)"),
    own("gamma", ELASTIC_BOUNDS, "exponent γ of that spectrum"),
    *CLASSES, MESH_RESOLUTION, COHERENCE, *VARIATION,
)


class ElasticBed(SedimentBed):
    """Elastic seabed."""

    law, bounds, declared = ElasticSediment, ELASTIC_BOUNDS, ATTRIBUTES

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        every = np.array([sediment.fluctuations for sediment in self.sediments])
        self.fluctuations = [Parameter(column[:1] if np.ptp(column) == 0 else column) for column in every.T]

    def _below(self, value, number, active):
        """Return the half-space under the surface."""
        shear = dr.minimum(value["shear_speed_ratio"], 0.999 * FASTEST_SHEAR * value["sound_speed_ratio"])
        density, compressional, shearing = (parameter.of_class(number, active) for parameter in self.fluctuations)
        return Elastic(arithmetic=self.arithmetic, shear_speed_ratio=shear,
                       fluctuations=(density, compressional, shearing), **{name: value[name] for name in SOLID})

    def to_string(self) -> str:
        return f"Elastic[{', '.join(self.named)}]"


mi.register_bsdf("elastic", ElasticBed)
