"""How surfaces scatter sound: laws of the seabed, of targets and of the sea surface, one a file."""
from mitsonar.seabed.fractal import Fractal
from mitsonar.seabed.relief import Plane, Relief, Sinusoid, Sum
from mitsonar.seabed.ripples import Ripples
from mitsonar.seabed.roughness import RoughnessSpectrum

from .cylinder_series import cylinder_form
from .elastic_sediment import ELASTIC_SEDIMENTS, ElasticSediment
from .empirical import EmpiricalSeabed
from .scattering_functions import ScatteringTable, SphereScattering
from .sea_surface import SeaSurface, bubble_loss_db
from .sediment import SEDIMENTS, Sediment
from .sphere_series import MATERIALS, Solid, SphereBody, sphere_form
from .spheres import sphere_target_strength_db
from .strength import LAWS, LambertSeabed, backscatter_strength_db, bistatic_strength_db

__all__ = ["ELASTIC_SEDIMENTS", "LAWS", "MATERIALS", "SEDIMENTS", "ElasticSediment", "EmpiricalSeabed", "Fractal",
           "LambertSeabed", "Plane", "Relief", "Ripples", "RoughnessSpectrum", "ScatteringTable", "SeaSurface",
           "Sediment", "Sinusoid", "Solid", "SphereBody", "SphereScattering", "Sum", "backscatter_strength_db",
           "bistatic_strength_db", "bubble_loss_db", "cylinder_form", "sphere_form", "sphere_target_strength_db"]
