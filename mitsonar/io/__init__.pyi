from . import (
    casts as casts,
    echo_sounder_lines as echo_sounder_lines,
    reading as reading,
    sidescan_lines as sidescan_lines,
    survey_lines as survey_lines,
    tracks as tracks,
    xtf as xtf,
)
from .bags import bag as bag
from .grids import bathymetry as bathymetry, raster_files as raster_files, soundings as soundings
from .reading import read as read, write as write
from .records import (
    exr as exr,
    geotiff as geotiff,
    hdf5 as hdf5,
    netcdf as netcdf,
    raw_echoes as raw_echoes,
    signals as signals,
)
from .scene_files import (
    arrays as arrays,
    backscatter as backscatter,
    beam_levels as beam_levels,
    meshes as meshes,
    scattering_tables as scattering_tables,
    scenes as scenes,
)
