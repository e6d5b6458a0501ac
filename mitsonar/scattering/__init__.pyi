from mitsonar.seabed.fractal import Fractal as Fractal
from mitsonar.seabed.marks import DragMarks as DragMarks, PockMarks as PockMarks, SandRibbons as SandRibbons
from mitsonar.seabed.relief import Plane as Plane, Relief as Relief, Sinusoid as Sinusoid, Sum as Sum
from mitsonar.seabed.ripples import Ripples as Ripples
from mitsonar.seabed.roughness import RoughnessSpectrum as RoughnessSpectrum

from .bodies.cylinder_series import cylinder_form as cylinder_form
from .bodies.scattering_functions import (
    ScatteringTable as ScatteringTable,
    SphereScattering as SphereScattering,
)
from .bodies.sphere_series import (
    MATERIALS as MATERIALS,
    Solid as Solid,
    SphereBody as SphereBody,
    sphere_form as sphere_form,
)
from .bodies.spheres import sphere_target_strength_db as sphere_target_strength_db
from .laws.elastic_sediment import ELASTIC_SEDIMENTS as ELASTIC_SEDIMENTS, ElasticSediment as ElasticSediment
from .laws.empirical import EmpiricalSeabed as EmpiricalSeabed
from .laws.sea_surface import SeaSurface as SeaSurface, bubble_loss_db as bubble_loss_db
from .laws.sediment import SEDIMENTS as SEDIMENTS, Sediment as Sediment
from .laws.strength import (
    LAWS as LAWS,
    LambertSeabed as LambertSeabed,
    backscatter_strength_db as backscatter_strength_db,
    bistatic_strength_db as bistatic_strength_db,
)
