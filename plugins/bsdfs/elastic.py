"""Solid seabed (`elastic`): as `sediment`, of cobble and rock, which bear shear waves.

- ``sediment`` ["rock"]: "cobble" ("gravel", "pebble"), "rock" or "rough rock", of APL-UW TM 2-00
- ``density_ratio``, ``sound_speed_ratio``, ``loss``, ``shear_speed_ratio``, ``shear_loss``, ``w2`` [m^(4 - γ)],
  ``gamma``, ``w3``: numbers or textures in place of its own; see `mitsonar.scattering.ElasticSediment`. Textures are
  clipped to the valid range, and shear to below 0.866 of the speed of compressional waves.
- ``sediment_class``, ``classes``, ``class_scale``, ``mesh_resolution``: as in `sediment`

.. code-block:: xml

    <bsdf type="elastic" id="reef"><string name="sediment" value="rough rock"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.plugins.bsdfs.parameter import Parameter
from mitsonar.plugins.bsdfs.sediment import SedimentBed
from mitsonar.scattering.elastic import Elastic
from mitsonar.scattering.elastic_sediment import ELASTIC_BOUNDS, FASTEST_SHEAR, ElasticSediment

SOLID = "density_ratio", "sound_speed_ratio", "loss", "shear_loss", "w3"


class ElasticBed(SedimentBed):
    """See the module's text."""

    law, bounds, default, volume = ElasticSediment, ELASTIC_BOUNDS, "rock", "w3"

    def __init__(self, props):
        super().__init__(props)
        every = np.array([sediment.fluctuations for sediment in self.sediments])
        self.fluctuations = [Parameter(column[:1] if np.ptp(column) == 0 else column) for column in every.T]

    def _below(self, value, number, active):
        """The half-space under the surface."""
        shear = dr.minimum(value["shear_speed_ratio"], 0.999 * FASTEST_SHEAR * value["sound_speed_ratio"])
        fluctuations = tuple(parameter(None, number, active) for parameter in self.fluctuations)
        return Elastic(arithmetic=self.arithmetic, shear_speed_ratio=shear, fluctuations=fluctuations,
                       **{name: value[name] for name in SOLID})

    def to_string(self):
        return f"Elastic[{', '.join(self.named)}]"


mi.register_bsdf("elastic", ElasticBed)
