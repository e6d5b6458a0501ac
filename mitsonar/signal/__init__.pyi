from . import beamforming as beamforming
from .accumulation import ImpulseResponses as ImpulseResponses, centre as centre
from .doppler import (
    doppler_class as doppler_class,
    doppler_classes as doppler_classes,
    two_way_doppler as two_way_doppler,
)
from .impulses import (
    KERNELS as KERNELS,
    element_responses as element_responses,
    in_band_error_db as in_band_error_db,
    make_kernel as make_kernel,
    response_spectrum as response_spectrum,
)
from .matched_filtering import matched_filter as matched_filter
from .noise import ElementNoise as ElementNoise, isotropic_coherence as isotropic_coherence
from .reception import (
    absorbed as absorbed,
    delayed as delayed,
    received as received,
    received_classes as received_classes,
    transmitted as transmitted,
)
