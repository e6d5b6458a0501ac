"""Every scattering law, at parameters that are hard for it: tests of laws and of their materials run over these."""
from dataclasses import fields

import numpy as np

from mitsonar.scattering import (
    ELASTIC_SEDIMENTS,
    SEDIMENTS,
    ElasticSediment,
    EmpiricalSeabed,
    LambertSeabed,
    SeaSurface,
    Sediment,
)
from mitsonar.scattering.laws import lambert

MEASURED = dict(angles=np.radians([8, 20, 45, 75, 90]), frequencies=[30e3, 300e3],
                strengths_db=[[-32, -28], [-26, -22], [-20, -18], [-14, -14], [-4, -9]])
DEGREES = np.radians(np.arange(1, 91))
CASES = {                          # law -> {name: object}
    "lambert": {"strongest": LambertSeabed(mu_db=10 * np.log10(lambert.STRONGEST))},
    "sediment": {**{name: Sediment.of(name) for name in SEDIMENTS},
                 "resolved": Sediment.of("coarse sand", mesh_resolution=0.1),
                 "shallow spectrum": Sediment.of("sand", gamma=2.6, w2=5e-7),
                 "steep spectrum": Sediment.of("sand", gamma=3.8, w2=1e-3)},
    "elastic": {name: ElasticSediment.of(name) for name in ELASTIC_SEDIMENTS},
    "empirical": {"measured": EmpiricalSeabed(**MEASURED),
                  "all that comes in": EmpiricalSeabed(angles=DEGREES, strengths_db=20 * np.log10(np.sin(DEGREES))
                                                       - 4.98)},
    "sea_surface": {f"{wind} m/s": SeaSurface(wind_speed=wind) for wind in (1, 5, 15)},
}
OTHERWISE = "sediment", "elastic", "empirical", "sea_surface"        # their materials have other names or attributes


def parameters_of(law):
    """Parameters that make a law's object."""
    return {field.name: getattr(law, field.name) for field in fields(law)}


def materials():
    """Materials with the names and the parameters of their laws, and the laws' objects, by name."""
    firsts = {name: next(iter(laws.values())) for name, laws in CASES.items() if name not in OTHERWISE}
    return {name: ({"type": name, **parameters_of(law)}, law) for name, law in firsts.items()}
