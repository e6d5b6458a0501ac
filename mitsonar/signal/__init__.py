"""Turn echoes into signals: impulse responses, Doppler, noise, reception, matched filter, beams."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
