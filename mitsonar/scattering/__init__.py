"""How surfaces scatter sound: laws of the seabed, of targets and of the sea surface, one a file."""
from mitsonar.seabed.fractal import Fractal
from mitsonar.seabed.relief import Plane, Relief, Sinusoid, Sum
from mitsonar.seabed.ripples import Ripples
from mitsonar.seabed.roughness import RoughnessSpectrum

from .bodies.cylinder_series import cylinder_form
from .bodies.scattering_functions import ScatteringTable, SphereScattering
from .bodies.sphere_series import MATERIALS, Solid, SphereBody, sphere_form
from .bodies.spheres import sphere_target_strength_db
from .laws.elastic_sediment import ELASTIC_SEDIMENTS, ElasticSediment
from .laws.empirical import EmpiricalSeabed
from .laws.sea_surface import SeaSurface, bubble_loss_db
from .laws.sediment import SEDIMENTS, Sediment
from .laws.strength import LAWS, LambertSeabed, backscatter_strength_db, bistatic_strength_db

__all__ = ["ELASTIC_SEDIMENTS", "LAWS", "MATERIALS", "SEDIMENTS", "ElasticSediment", "EmpiricalSeabed", "Fractal",
           "LambertSeabed", "Plane", "Relief", "Ripples", "RoughnessSpectrum", "ScatteringTable", "SeaSurface",
           "Sediment", "Sinusoid", "Solid", "SphereBody", "SphereScattering", "Sum", "backscatter_strength_db",
           "bistatic_strength_db", "bubble_loss_db", "cylinder_form", "sphere_form", "sphere_target_strength_db"]
