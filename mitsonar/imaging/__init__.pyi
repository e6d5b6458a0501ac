from . import picture_statistics as picture_statistics
from .maps.mosaics import mosaic as mosaic
from .maps.raster import cartesian as cartesian
from .recording import recorded_levels as recorded_levels
