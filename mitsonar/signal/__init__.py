"""From hits to echoes."""
from .doppler import doppler_class, doppler_classes, two_way_doppler
from .echoes import EchoSums, echo_energy
from .matched_filter import matched_filter
from .noise import ElementNoise, isotropic_coherence
from .reception import absorbed, delayed, received, received_classes, transmitted

__all__ = ["EchoSums", "ElementNoise", "absorbed", "delayed", "doppler_class", "doppler_classes", "echo_energy",
           "isotropic_coherence", "matched_filter", "received", "received_classes", "transmitted", "two_way_doppler"]
