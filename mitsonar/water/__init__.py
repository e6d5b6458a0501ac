"""Water: sound speed, absorption and noise, as plain functions of depth, temperature and salinity."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
