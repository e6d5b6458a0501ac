"""Lines that echo sounders recorded, in raw files of the EK80 and its kin."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
