"""From echoes to signals: impulse responses, Doppler, noise, reception, matched filter, beams."""
from . import beamforming
from .accumulation import ImpulseResponses, centre
from .doppler import doppler_class, doppler_classes, two_way_doppler
from .impulses import KERNELS, element_responses, in_band_error_db, make_kernel, response_spectrum
from .matched_filter import matched_filter
from .noise import ElementNoise, isotropic_coherence
from .reception import absorbed, delayed, received, received_classes, transmitted

__all__ = ["ElementNoise", "ImpulseResponses", "KERNELS", "absorbed", "beamforming", "centre", "delayed",
           "doppler_class", "doppler_classes", "element_responses", "in_band_error_db",
           "isotropic_coherence", "make_kernel", "matched_filter", "received", "received_classes",
           "response_spectrum", "transmitted", "two_way_doppler"]
