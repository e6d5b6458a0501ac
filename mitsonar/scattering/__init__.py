"""How surfaces scatter sound: laws of the seabed, of targets and of the sea surface, one a file."""
from ..seabed.fractal import Fractal
from ..seabed.relief import Plane, Relief, Sinusoid, Sum
from ..seabed.ripples import Ripples
from ..seabed.roughness import RoughnessSpectrum
from .elastic_sediment import ELASTIC_SEDIMENTS, ElasticSediment
from .empirical import EmpiricalSeabed
from .sea_surface import SeaSurface, bubble_loss_db
from .sediment import SEDIMENTS, Sediment
from .spheres import sphere_target_strength_db
from .strength import LAWS, LambertSeabed, backscatter_strength_db, bistatic_strength_db

__all__ = ["ELASTIC_SEDIMENTS", "LAWS", "SEDIMENTS", "ElasticSediment", "EmpiricalSeabed", "Fractal", "LambertSeabed",
           "Plane", "Relief", "Ripples", "RoughnessSpectrum", "SeaSurface", "Sediment", "Sinusoid", "Sum",
           "backscatter_strength_db", "bistatic_strength_db", "bubble_loss_db", "sphere_target_strength_db"]
