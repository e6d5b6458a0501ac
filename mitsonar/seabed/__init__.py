"""Shape of the seabed, and objects on it with random pose, burial and position."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
