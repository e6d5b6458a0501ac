"""The seabed's shape, and where objects lie on it: poses, burial and places drawn at random, on beds of triangles."""
from .bed import Bed
from .bodies import Body
from .placement import Placed, Rules, draw_count, place

__all__ = ["Bed", "Body", "Placed", "Rules", "draw_count", "place"]
