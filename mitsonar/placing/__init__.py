"""Where objects lie on a seabed: poses, burial and places drawn at random, over any bed of triangles."""
from .bed import Bed
from .bodies import Body
from .drawing import Placed, Rules, draw_count, place

__all__ = ["Bed", "Body", "Placed", "Rules", "draw_count", "place"]
