"""The seabed's shape, and where objects lie on it: poses, burial and places drawn at random, on beds of triangles."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
