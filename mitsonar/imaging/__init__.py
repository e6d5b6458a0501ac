"""From echoes to images, one kind of sonar a file; and images of fans as pictures in metres.

    picture = mitsonar.imaging.cartesian(image, cell=0.05)                  (ping, y, x)
    chart = mitsonar.imaging.mosaic([north, south], cell=0.25)              (y, x), eastings and northings
"""
from .mosaics import mosaic
from .raster import cartesian

__all__ = ["cartesian", "mosaic"]
