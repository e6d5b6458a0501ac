"""Images from echoes, one module per kind of sonar, and images of fans as pictures in metres.

    picture = mitsonar.imaging.cartesian(image, cell=0.05)                  (ping, y, x)
    chart = mitsonar.imaging.mosaic([north, south], cell=0.25)              (y, x), eastings and northings
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
